"""Say where a generated text has a placeholder in place of a number, or the grammar of another number."""

import re

FAULTS = {
    "a dash for a number": r"[ (]- (points|kPa|mm|%|ms|s|N|seeds|times)\b",
    "a count that there is not": r"(?<!\| )not counted(?! *\|)",
    "one in the plural": r"(?<![\d.,/-])(?<!of )\b1 (seeds|runs|models|points|presses|recordings|claims|frames)\b",
    "all of two": r"\ball 2 models\b",
    "images for errors": r"\bsmallest images\b",
    "no number": r"(?<![\w.])(nan|None|inf)\b(?! of)",
}
CELL = re.compile(r"</?t[dh]\b[^>]*>")
MARKUP = re.compile(r"<script.*?</script>|<style.*?</style>|<[^>]*>|`[^`]*`|data:[\w/;,+=]+", re.DOTALL)


def faults(text: str) -> list[tuple[str, str]]:
    """Return (what is wrong, the words around it) of a text in Markdown or HTML; code and markup do not count."""
    plain = MARKUP.sub(" ", CELL.sub(" | ", text))
    return [
        (what, " ".join(plain[max(0, found.start() - 50) : found.end() + 30].split()))
        for what, pattern in FAULTS.items()
        for found in re.finditer(pattern, plain)
    ]
