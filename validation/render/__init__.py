"""Drawing of results: one table for terminal, page and file, and one tactile image."""

#: Largest number of characters that are printed of a text from a file [-]; the middle of a longer text is left out.
_LONGEST = 2000
#: Number of characters from the end that are printed of a text that is cut [-], because messages end with the reason.
_END = 200


def escape(text: str) -> str:
    r"""Replace characters of a text that could steer a terminal, such as escape sequences, by `\x1b` and the like.

    Names and notes come from files that strangers wrote.  All characters that are not printable are replaced, also
    those that change the direction of writing.  The middle of a text of more than 2000 characters is left out.
    """
    cut = text
    if len(text) > _LONGEST:
        cut = f"{text[: _LONGEST - _END]}... ({len(text)} characters) ...{text[-_END:]}"
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in cut)
