"""The API as a script talks to it: a request, an answer that is as expected, its JSON."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import httpx
from waiting import until

OVER = ("done", "failed", "cancelled")


@dataclass
class ApiDriver:
    """Asks by a client that was let in.

    Each of its verbs takes an address, what is sent as JSON, the status that the answer has (None: any of success), the
    window that asks and more of `httpx.Client.request`, and gives the answer's JSON, {} where it is none.
    """

    client: httpx.Client

    def get(self, path: str, code: int | None = None, **more: object) -> dict:
        return self._asked("GET", path, None, code, more)

    def post(self, path: str, body: object = None, code: int | None = None, **more: object) -> dict:
        return self._asked("POST", path, body, code, more)

    def put(self, path: str, body: object = None, code: int | None = None, **more: object) -> dict:
        return self._asked("PUT", path, body, code, more)

    def patch(self, path: str, body: object = None, code: int | None = None, **more: object) -> dict:
        return self._asked("PATCH", path, body, code, more)

    def delete(self, path: str, code: int | None = None, **more: object) -> dict:
        return self._asked("DELETE", path, None, code, more)

    def _asked(
        self, method: str, path: str, body: object, code: int | None, more: Mapping[str, object]
    ) -> dict:
        options: dict = {**more}
        if window := options.pop("window", ""):
            options["headers"] = {"x-studio-window": window}
        answer = self.client.request(method, path, json=body, **options)
        assert answer.is_success if code is None else answer.status_code == code, f"{answer} {answer.text}"
        is_json = answer.content and answer.headers.get("content-type") == "application/json"
        return answer.json() if is_json else {}

    def text(self, path: str) -> str:
        """An answer that is no JSON."""
        answer = self.client.get(path)
        assert answer.is_success, answer.text
        return answer.text

    def upload(self, files: Mapping[str, bytes]) -> str:
        """An upload of files by name, and how it is called."""
        identifier = self.post("/api/uploads")["identifier"]
        for name, content in files.items():
            self.put(f"/api/uploads/{identifier}/files", params={"path": name}, content=content)
        return identifier

    def when(self, path: str, wanted: Callable[[dict], object]) -> dict:
        """What an address answers once it is as wanted."""
        answers: list[dict] = []

        def is_wanted() -> object:
            answers[:] = [self.get(path)]
            return wanted(answers[0])

        until(is_wanted)
        return answers[0]

    def ended(self, path: str, entry: str = "") -> dict:
        """The state of the job at an address (or in an entry of the answer) once it is over."""

        def job_of(answer: dict) -> dict:
            return (answer[entry] if entry else answer) or {}

        return job_of(self.when(path, lambda answer: job_of(answer).get("state") in OVER))
