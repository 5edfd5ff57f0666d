"""A page read back: whether it is one document, and what a browser would load and run."""

from __future__ import annotations

from html.parser import HTMLParser

_VOID = {"meta", "br", "wbr", "img", "link", "input"}


class Page(HTMLParser):
    """Elements opened and closed in order, ids, texts, and the addresses in attributes."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.scripts: list[str] = []
        self.numbers: list[float] = []
        self.feed(text)
        self.close()
        assert not self.open, f"not closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if (value := dict(attrs).get("data-value")) is not None:
            self.numbers.append(float(value))
        if tag not in _VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open[-1:] == [tag], f"</{tag}> closes {self.open[-3:]}"
        self.open.pop()

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "script":
            self.scripts.append(data)
        elif self.open and self.open[-1] != "style":
            self.texts.append(data)

    @property
    def text(self) -> str:
        return " ".join(self.texts)

    def count(self, tag: str) -> int:
        return sum(name == tag for name, _ in self.elements)

    def addresses(self) -> list[str]:
        """Everything that an attribute of an element would make a browser fetch or go to."""
        loading = {"src", "href", "srcset", "data", "action", "poster", "xlink:href", "formaction", "background"}
        return [value or "" for _, attributes in self.elements for name, value in attributes.items() if name in loading]

    def handlers(self) -> list[str]:
        """Attributes that would run a script."""
        return [name for _, attributes in self.elements for name in attributes if name.startswith("on")]
