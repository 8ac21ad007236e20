"""Regular expressions of users: searched in linear time, with the meaning that Python's `re` gives them.

`re` may take longer than the age of the universe for a line of 100 characters, and settings travel with logs. RE2 takes
time that grows with the line alone. It knows letters and digits of ASCII only in its classes, which are written out.
"""

import re
import warnings
from typing import Protocol

import re2

# `check` proposes it for zones behind times. RE2 has no look-around; `re` takes 0.1 s for a megabyte of any text.
ZONE = r"(?<=[0-9])(Z|[+-][0-9]{2}:[0-9]{2})(?![0-9:])"
# What `re` means by a class, in RE2's words, for use in brackets.
_WORD, _DIGIT, _SPACE = r"\p{L}\p{N}_", r"\p{Nd}", r"\t-\r\x1c-\x20\x{85}\p{Z}"
_CLASSES = {r"\w": f"[{_WORD}]", r"\d": f"[{_DIGIT}]", r"\s": f"[{_SPACE}]"}
_CLASSES |= {r"\W": f"[^{_WORD}]", r"\D": f"[^{_DIGIT}]", r"\S": f"[^{_SPACE}]"}
_IN_BRACKETS = {r"\w": _WORD, r"\d": _DIGIT, r"\s": _SPACE, r"\D": r"\P{Nd}"}
_PARTS = re.compile(r"\\.|\{,(?=[0-9]*\})|.", re.DOTALL)
_OPTIONS = re2.Options()
_OPTIONS.log_errors = False  # they come as exceptions


class Pattern(Protocol):
    """What patterns of `re` and of RE2 have in common."""

    @property
    def groups(self) -> int: ...
    def search(self, text: str, /) -> re.Match[str] | None: ...
    def fullmatch(self, text: str, /) -> re.Match[str] | None: ...
    def sub(self, into: str, text: str, /) -> str: ...


def compiled(pattern: str) -> Pattern:
    """Return a pattern, which means what `re` means by it.

    Raises ValueError, which says why, for what is no regular expression of `re` or cannot be searched in linear time.
    """
    try:
        with warnings.catch_warnings(action="ignore"):  # of sets that a later Python may read otherwise
            expected = re.compile(pattern)
    except (re.error, OverflowError, RecursionError) as error:
        raise ValueError(f"'{pattern}' is no regular expression ({error})") from error
    if pattern == ZONE:
        return expected
    try:
        return re2.compile(_in_words_of_re2(pattern), _OPTIONS)
    except (re2.error, ValueError, UnicodeError) as error:
        reason = error.args[0] if error.args else error
        reason = reason.decode(errors="replace") if isinstance(reason, bytes) else reason
        raise ValueError(
            f"'{pattern}' cannot be searched in a time that grows with the line alone ({reason}): look-around, "
            r"\1, \b and large counts are not taken; write what stands there"
        ) from error


def _in_words_of_re2(pattern: str) -> str:
    """Return a pattern of `re` as RE2 has to read it, so that it means the same; ValueError where it cannot."""
    written, inside, first = [], False, False  # inside: square brackets; first: of their content
    for part in _PARTS.findall(pattern):
        if inside and part in (r"\W", r"\S"):
            raise ValueError(f"{part} in square brackets")
        if not inside and part in (r"\b", r"\B"):
            raise ValueError(part)
        if not inside:
            written.append("{0," if part == "{," else _CLASSES.get(part, part))
            inside = first = part == "["
        elif part == "^" and first and written[-1] == "[":
            written.append(part)
        else:
            inside, is_sign = part != "]" or first, part in ("[", "]") and (part == "[" or first)
            written.append(rf"\{part}" if is_sign else _IN_BRACKETS.get(part, part))  # [: names a class to RE2
            first = False
    return "".join(written)
