"""A page in one file, as tests read it."""

from html.parser import HTMLParser


class HtmlPage(HTMLParser):
    """Every address that a page names, and its scripts by type."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.scripts: dict[str, str] = {}
        self._kind = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.addresses += [values[name] or "" for name in ("src", "href") if name in values]
        self._kind = (values.get("type") or "plain") if tag == "script" else ""

    def handle_data(self, data: str) -> None:
        if self._kind:
            self.scripts[self._kind] = self.scripts.get(self._kind, "") + data

    def handle_endtag(self, tag: str) -> None:
        self._kind = ""
