# ruff: noqa: E501 - a row of a table is a line
"""Variable-length codes of H.264 (ITU-T H.264, 9.1 and 9.2: Exp-Golomb and CAVLC).

What the simulated camera needs of them: only blocks without coded neighbours: their coeff_token is that of nC 0 (luma) and -1 (chroma DC).
"""

from __future__ import annotations

from collections.abc import Sequence

# Each code is (length, bits), the tables those of the standard, their place in the comment.

_TOKEN = (  # table 9-5, 0 <= nC < 2: by number of coefficients, then of trailing ones
    ((1, 1),),
    ((6, 5), (2, 1)),
    ((8, 7), (6, 4), (3, 1)),
    ((9, 7), (8, 6), (7, 5), (5, 3)),
    ((10, 7), (9, 6), (8, 5), (6, 3)),
    ((11, 7), (10, 6), (9, 5), (7, 4)),
    ((13, 15), (11, 6), (10, 5), (8, 4)),
    ((13, 11), (13, 14), (11, 5), (9, 4)),
    ((13, 8), (13, 10), (13, 13), (10, 4)),
    ((14, 15), (14, 14), (13, 9), (11, 4)),
    ((14, 11), (14, 10), (14, 13), (13, 12)),
    ((15, 15), (15, 14), (14, 9), (14, 12)),
    ((15, 11), (15, 10), (15, 13), (14, 8)),
    ((16, 15), (15, 1), (15, 9), (15, 12)),
    ((16, 11), (16, 14), (16, 13), (15, 8)),
    ((16, 7), (16, 10), (16, 9), (16, 12)),
    ((16, 4), (16, 6), (16, 5), (16, 8)),
)
_CHROMA_TOKEN = (  # table 9-5, nC == -1
    ((2, 1),),
    ((6, 7), (1, 1)),
    ((6, 4), (6, 6), (3, 1)),
    ((6, 3), (7, 3), (7, 2), (6, 5)),
    ((6, 2), (8, 3), (8, 2), (7, 0)),
)
_ZEROS = (  # tables 9-7 and 9-8: by number of coefficients - 1, then by total_zeros
    ((1, 1), (3, 3), (3, 2), (4, 3), (4, 2), (5, 3), (5, 2), (6, 3), (6, 2), (7, 3), (7, 2), (8, 3), (8, 2), (9, 3), (9, 2), (9, 1)),
    ((3, 7), (3, 6), (3, 5), (3, 4), (3, 3), (4, 5), (4, 4), (4, 3), (4, 2), (5, 3), (5, 2), (6, 3), (6, 2), (6, 1), (6, 0)),
    ((4, 5), (3, 7), (3, 6), (3, 5), (4, 4), (4, 3), (3, 4), (3, 3), (4, 2), (5, 3), (5, 2), (6, 1), (5, 1), (6, 0)),
    ((5, 3), (3, 7), (4, 5), (4, 4), (3, 6), (3, 5), (3, 4), (4, 3), (3, 3), (4, 2), (5, 2), (5, 1), (5, 0)),
    ((4, 5), (4, 4), (4, 3), (3, 7), (3, 6), (3, 5), (3, 4), (3, 3), (4, 2), (5, 1), (4, 1), (5, 0)),
    ((6, 1), (5, 1), (3, 7), (3, 6), (3, 5), (3, 4), (3, 3), (3, 2), (4, 1), (3, 1), (6, 0)),
    ((6, 1), (5, 1), (3, 5), (3, 4), (3, 3), (2, 3), (3, 2), (4, 1), (3, 1), (6, 0)),
    ((6, 1), (4, 1), (5, 1), (3, 3), (2, 3), (2, 2), (3, 2), (3, 1), (6, 0)),
    ((6, 1), (6, 0), (4, 1), (2, 3), (2, 2), (3, 1), (2, 1), (5, 1)),
    ((5, 1), (5, 0), (3, 1), (2, 3), (2, 2), (2, 1), (4, 1)),
    ((4, 0), (4, 1), (3, 1), (3, 2), (1, 1), (3, 3)),
    ((4, 0), (4, 1), (2, 1), (1, 1), (3, 1)),
    ((3, 0), (3, 1), (1, 1), (2, 1)),
    ((2, 0), (2, 1), (1, 1)),
    ((1, 0), (1, 1)),
    ((0, 0),),
)  # fmt: skip
_CHROMA_ZEROS = (  # table 9-9 (a)
    ((1, 1), (2, 1), (3, 1), (3, 0)),
    ((1, 1), (2, 1), (2, 0)),
    ((1, 1), (1, 0)),
    ((0, 0),),
)
_RUN = (  # table 9-10: by zeros left - 1 (at most 6), then by run_before
    ((1, 1), (1, 0)),
    ((1, 1), (2, 1), (2, 0)),
    ((2, 3), (2, 2), (2, 1), (2, 0)),
    ((2, 3), (2, 2), (2, 1), (3, 1), (3, 0)),
    ((2, 3), (2, 2), (3, 3), (3, 2), (3, 1), (3, 0)),
    ((2, 3), (3, 0), (3, 1), (3, 3), (3, 2), (3, 5), (3, 4)),
    ((3, 7), (3, 6), (3, 5), (3, 4), (3, 3), (3, 2), (3, 1), (4, 1), (5, 1), (6, 1), (7, 1), (8, 1), (9, 1), (10, 1), (11, 1)),
)  # fmt: skip


def ue(value: int) -> str:
    """Return an unsigned Exp-Golomb code."""
    code = f"{value + 1:b}"
    return "0" * (len(code) - 1) + code


def se(value: int) -> str:
    """Return a signed Exp-Golomb code."""
    return ue(2 * value - 1 if value > 0 else -2 * value)


def luma_dc(coefficients: Sequence[int]) -> str:
    """Return the code of 16 coefficients in zigzag order."""
    return _block(coefficients, _TOKEN, _ZEROS)


def chroma_dc(coefficients: Sequence[int]) -> str:
    """Return the code of 4 coefficients in raster order."""
    return _block(coefficients, _CHROMA_TOKEN, _CHROMA_ZEROS)


Code = tuple[int, int]


def _bits(code: Code) -> str:
    length, bits = code
    return f"{bits:0{length}b}" if length else ""


def _block(coefficients: Sequence[int], tokens: Sequence[Sequence[Code]], zeros: Sequence[Sequence[Code]]) -> str:
    places = [place for place, level in enumerate(coefficients) if level]
    levels = [coefficients[place] for place in reversed(places)]  # from the highest frequency down
    ones = next((n for n, level in enumerate(levels[:3]) if abs(level) != 1), min(3, len(levels)))
    text = [_bits(tokens[len(levels)][ones])]
    if not levels:
        return text[0]
    text += ["1" if level < 0 else "0" for level in levels[:ones]]
    text += _levels(levels[ones:], len(levels), ones)
    total = places[-1] + 1 - len(places)
    if len(levels) < len(coefficients):
        text.append(_bits(zeros[len(levels) - 1][total]))
    left = total
    for place, before in zip(reversed(places[1:]), reversed(places[:-1]), strict=True):
        if not left:
            break
        run = place - before - 1
        text.append(_bits(_RUN[min(left, 7) - 1][run]))
        left -= run
    return "".join(text)


def _levels(levels: Sequence[int], count: int, ones: int) -> list[str]:
    """Return the codes of the levels after the trailing ones (9.2.2.1)."""
    text = []
    suffix = 1 if count > 10 and ones < 3 else 0
    for index, level in enumerate(levels):
        code = 2 * level - 2 if level > 0 else -2 * level - 1
        if index == 0 and ones < 3:
            code -= 2  # a level of 1 would have been a trailing one
        text.append(_level(code, suffix))
        if suffix == 0:
            suffix = 1
        if abs(level) > 3 << (suffix - 1) and suffix < 6:
            suffix += 1
    return text


def _level(code: int, suffix: int) -> str:
    """Return level_prefix and level_suffix."""
    if suffix == 0 and code >= 14:
        if code < 30:
            return "0" * 14 + "1" + f"{code - 14:04b}"
        return "0" * 15 + "1" + f"{code - 30:012b}"
    prefix = code >> suffix
    if prefix >= 15:
        return "0" * 15 + "1" + f"{code - (15 << suffix):012b}"
    return "0" * prefix + "1" + (f"{code & (1 << suffix) - 1:0{suffix}b}" if suffix else "")
