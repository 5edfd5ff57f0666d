"""HTML and SVG as nested calls: `tag("p", text, class_="note")`. Whatever is not Html is escaped."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence

# Characters that a document must not contain, and surrogates, which no file can be written with.
_FORBIDDEN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
_VOID = {"meta", "wbr"}


class Html(str):
    """Text that is markup already."""

    __slots__ = ()


Content = str | float | None | Sequence["Content"]


def escape(text: object) -> Html:
    """Text as it is to be read, in content and in attributes."""
    return Html(html.escape(_FORBIDDEN.sub("\ufffd", str(text))))


def join(content: Content) -> Html:
    """Content as markup: Html as it is, text and numbers escaped, None nothing, sequences one after the other."""
    if isinstance(content, Html):
        return content
    if content is None:
        return Html()
    if isinstance(content, str | int | float):
        return escape(content)
    return Html("".join(join(part) for part in content))


def tag(name: str, /, *content: Content, **attributes: str | float | bool | None) -> Html:
    """An element. `class_` is class and `data_value` data-value; True stands alone, None and False are left out."""
    written = "".join(
        f" {key.rstrip('_').replace('_', '-')}" + ("" if value is True else f'="{escape(value)}"')
        for key, value in attributes.items()
        if value is not None and value is not False
    )
    return Html(f"<{name}{written}>" if name in _VOID else f"<{name}{written}>{join(content)}</{name}>")


def breakable(name: str) -> Html:
    """A name that may be broken behind its dots and underscores."""
    return Html(tag("wbr").join(escape(part) for part in re.split(r"(?<=[._])", name)))
