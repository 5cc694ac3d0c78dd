"""Wraps paragraphs of comments that are wider than 99 columns, and touches nothing else."""

import re

import rust_source

WIDTH = 99
RUST = re.compile(r"^(\s*)(///|//!|//)( ?)(.*)$")
HASH = re.compile(r"^(\s*)(#)( ?)(.*)$")
ITEM = re.compile(r"^(\s*)([-*+]|\d+[.)])(\s+)")
# A line that begins like this would no longer be text.
MARK = re.compile(r"^([-*+=~]+|\d+[.)]|#+|[|>].*|```.*|\[[^]]*\]:.*)$")


def rust(text):
    """A .rs file with its line comments wrapped."""
    source = rust_source.Source("", text)
    # Only lines that are a comment from their first letter on: a text in quotes may look like one.
    pure = set()
    for offset, comment in source.comments:
        line = source.line_of(offset)
        before = text[source.line_starts[line - 1] : offset]
        if comment.startswith("//") and not comment.startswith("////") and not before.strip():
            pure.add(line)
    return _wrap(text, RUST, lambda number, line: number in pure)


def hashes(text):
    """The same of a file whose comments begin with a hash."""
    return _wrap(text, HASH, lambda number, line: re.match(r"\s*#( |$)", line))


def _wrap(text, pattern, is_comment):
    lines = text.split("\n")
    result, number = [], 0
    while number < len(lines):
        if not is_comment(number + 1, lines[number]):
            result.append(lines[number])
            number += 1
            continue
        prefix = pattern.match(lines[number]).group(1, 2)
        block = []
        while number < len(lines) and is_comment(number + 1, lines[number]):
            if pattern.match(lines[number]).group(1, 2) != prefix:
                break
            block.append(lines[number])
            number += 1
        result += _block(block, prefix[0] + prefix[1], pattern)
    return "\n".join(result)


def _block(block, prefix, pattern):
    """Comment lines with one indentation and one marker."""
    result, paragraph, fenced = [], [], False

    def flush():
        result.extend(_paragraph(paragraph, prefix, pattern))
        paragraph.clear()

    for line in block:
        _, _, space, words = pattern.match(line).groups()
        stripped = words.strip()
        fence = stripped.startswith(("```", "~~~"))
        # What stands four columns in is code, unless it goes on with an item of a list.
        indented = space and words.startswith("    ") and not paragraph
        structure = (
            fence or fenced or indented or not stripped or not space
            or stripped.startswith(("|", "#", ">", "<")) or re.match(r"\[[^]]*\]:", stripped)
        )
        if structure:
            flush()
            result.append(line)
            fenced ^= bool(fence)
            continue
        if ITEM.match(words):
            flush()
        paragraph.append(line)
    flush()
    return result


def _paragraph(lines, prefix, pattern):
    if not any(len(line) > WIDTH for line in lines):
        return lines
    texts = [pattern.match(line).group(4) for line in lines]
    # Columns, drawings and listings are laid out by hand.
    if any(re.search(r"\S {3,}\S|[─│┌┐└┘├┤┬┴┼▲▼]|\\$| $", text) for text in texts):
        return lines
    item = ITEM.match(texts[0])
    first = item.group() if item else re.match(r"\s*", texts[0]).group()
    rest = re.match(r"\s*", texts[1]).group() if len(texts) > 1 else ""
    if item and not rest:
        rest = " " * len(first)
    if not item and len({len(re.match(r"\s*", text).group()) for text in texts}) > 1:
        return lines
    if not item:
        rest = first
    words = " ".join([texts[0][len(first) :], *texts[1:]]).split()
    wrapped, line = [], prefix + " " + first
    begin = True
    for position, word in enumerate(words):
        following = words[position + 1] if position + 1 < len(words) else ""
        # A mark stays behind the word before it, so that word goes to the next line with it.
        reserve = len(following) + 1 if following and MARK.match(following) else 0
        fits = len(line) + (0 if begin else 1) + len(word) + reserve <= WIDTH
        if begin or fits or MARK.match(word):
            line += word if begin else " " + word
        else:
            wrapped.append(line)
            line = prefix + " " + rest + word
        begin = False
    wrapped.append(line)
    return wrapped
