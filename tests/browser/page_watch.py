"""What a page must never do: write errors to the console, have a request fail, contact another host."""

from http import HTTPStatus
from urllib.parse import urlsplit

from playwright.sync_api import ConsoleMessage, Page, Request, Response

LOCAL_SCHEMES = ("data", "blob", "about")


class PageWatch:
    """Listens to a page from before its first request on. allowed : texts that faults may contain."""

    def __init__(self, page: Page, origin: str) -> None:
        self.faults: list[str] = []
        self.requests: list[str] = []
        self.allowed: list[str] = []
        self._origin, self._host = origin, urlsplit(origin).netloc
        page.on("console", self._console)
        page.on("pageerror", lambda fault: self.faults.append(f"page error: {fault}"))
        page.on("request", self._request)
        page.on("requestfailed", self._failed)
        page.on("response", self._response)

    def allow(self, status: int, path: str) -> None:
        """Expect answers of that status at an address, and what the browser writes about them; no others."""
        phrase = HTTPStatus(status).phrase
        self.allowed += [
            f"status {status}: {self._origin}{path}",
            f"{status} ({phrase}) {self._origin}{path}",
        ]

    def check(self) -> None:
        """Nothing happened that should not."""
        faults = [fault for fault in self.faults if not any(text in fault for text in self.allowed)]
        assert faults == [], "\n".join(faults)

    def _console(self, message: ConsoleMessage) -> None:
        # viser's page gathers the changes of inputs that arrive together and makes them last, after an input among
        # them was taken out: nothing is lost, and no order on our side avoids it.
        if message.type == "error" and "Tried to update non-existent component" not in message.text:
            place = message.location.get("url", "") if message.location else ""
            self.faults.append(f"console: {message.text} {place}")

    def _request(self, request: Request) -> None:
        self.requests.append(f"{request.method} {urlsplit(request.url).path}")
        parts = urlsplit(request.url)
        if parts.scheme not in LOCAL_SCHEMES and parts.netloc != self._host:
            self.faults.append(f"another host: {request.url}")

    def _failed(self, request: Request) -> None:
        # What the page itself gives up (a view that it left, a download that the browser takes over) has not failed.
        if request.failure != "net::ERR_ABORTED":
            self.faults.append(f"failed: {request.url} {request.failure}")

    def _response(self, response: Response) -> None:
        if response.status >= 400:
            self.faults.append(f"status {response.status}: {response.url}")
