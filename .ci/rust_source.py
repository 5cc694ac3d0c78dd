"""Rust source as .ci/vocabulary needs it: code without comments and strings, items by name, production lines."""

import bisect
import re

TOKEN = re.compile(
    r"""(?P<comment>//[^\n]*|/\*.*?\*/)
      | (?<![A-Za-z0-9_])(?P<raw>b?r(?P<hashes>\#*)".*?"(?P=hashes))
      | (?P<string>"(?:\\.|[^"\\])*")
      | (?P<char>'(?:\\(?:x[0-9a-fA-F]{2}|u\{[^}]*\}|.)|[^\\'\n])')""",
    re.S | re.X,
)
ITEM = re.compile(
    r"\b(?:(fn|struct|enum|trait|type|union|mod|const|static|macro_rules!|let)\s+)(?:mut\s+|ref\s+|r#)*"
    r"([A-Za-z_][A-Za-z0-9_]*)"
)
KIND = {
    "fn": "fn", "struct": "type", "enum": "type", "trait": "type", "type": "type", "union": "type",
    "mod": "mod", "const": "const", "static": "const", "macro_rules!": "macro", "let": "local",
}
FIELD = re.compile(r"(?:pub(?:\s*\([^)]*\))?\s+)?(?:r#)?([a-z_][a-z0-9_]*)\s*:(?!:)")
VARIANT = re.compile(r"([A-Z][A-Za-z0-9]*)")
TEST = re.compile(r"#\s*\[\s*(?:cfg\s*\(\s*(?:all\s*\(\s*)?test\b[^\]]*|test)\s*\]")
KEY = re.compile(r"[a-z][a-z0-9_]*(?:[./-][a-z0-9_]+)*")


class Item:
    """A name of ours: its kind, where it stands, and whether only tests see it."""

    def __init__(self, kind, name, line, in_test):
        self.kind, self.name, self.line, self.in_test = kind, name, line, in_test


class Struct:
    """A struct: its name, line, number of fields, doc comment and attributes."""

    def __init__(self, name, line, fields, head):
        self.name, self.line, self.fields, self.head = name, line, fields, head


class Source:
    """One .rs file, taken apart."""

    def __init__(self, path, text):
        self.path, self.text = path, text
        self.line_starts = [0] + [m.end() for m in re.finditer("\n", text)]
        self.comments, self.strings = [], []
        pieces, last = [], 0
        for match in TOKEN.finditer(text):
            kind = match.lastgroup if match.lastgroup != "hashes" else "raw"
            start, end = match.span()
            if kind == "comment":
                self.comments.append((start, match.group()))
            elif kind in ("string", "raw"):
                self.strings.append((start, match.group().lstrip("br#").strip('#"')))
            blank = re.sub(r"[^\n]", " ", match.group())
            if kind == "comment":
                pieces += [text[last:start], blank]
            else:
                # Quotes stay, so that a line with nothing but a string is still a line of code.
                pieces += [text[last:start], '"' + blank[1:-1] + '"' if end - start > 1 else blank]
            last = end
        pieces.append(text[last:])
        self.code = "".join(pieces)
        self.in_tests = path.endswith("tests.rs") or any(
            folder in ("tests", "benches", "fuzz_targets") for folder in path.split("/")[:-1]
        )
        self.test_regions, self.test_modules = [], []
        self._find_test_regions()

    def line_of(self, offset):
        """The line of an offset, from 1."""
        return bisect.bisect_right(self.line_starts, offset)

    def is_test(self, offset):
        """Whether only tests see what stands at an offset."""
        return self.in_tests or any(start <= offset < end for start, end in self.test_regions)

    def closing(self, start):
        """The end of the block that a brace at `start` opens."""
        depth = 0
        for match in re.compile(r"[{}]").finditer(self.code, start):
            depth += 1 if match.group() == "{" else -1
            if depth == 0:
                return match.end()
        return len(self.code)

    def _find_test_regions(self):
        for match in TEST.finditer(self.code):
            end = re.compile(r"[{;]").search(self.code, match.end())
            if end is None:
                continue
            stop = self.closing(end.start()) if end.group() == "{" else end.end()
            self.test_regions.append((match.start(), stop))
            module = re.match(r"\s*(?:pub(?:\([^)]*\))?\s+)?mod\s+(\w+)\s*;", self.code[match.end():stop])
            if module:
                self.test_modules.append(module.group(1))

    def items(self):
        """Every item, field, variant, local and key of this file."""
        found = []
        for match in ITEM.finditer(self.code):
            kind, name = KIND[match.group(1)], match.group(2)
            if name in ("_", "fn", "mut", "in", "unsafe", "Some", "Ok", "Err", "None"):
                continue
            test = self.is_test(match.start())
            found.append(Item(kind, name, self.line_of(match.start()), test))
            if match.group(1) in ("struct", "enum", "union"):
                for offset, member in self._members(match.end(), match.group(1)):
                    member_kind = "variant" if match.group(1) == "enum" else "field"
                    found.append(Item(member_kind, member, self.line_of(offset), test))
        for offset, text in self.strings:
            # Former names, by which reports and logs of earlier builds are read, stay as they
            # were.
            before = self.code[max(0, offset - 16) : offset].rstrip()
            if KEY.fullmatch(text) and len(text) < 60 and not re.search(r"\b(alias|former) *=$", before):
                found.append(Item("key", text, self.line_of(offset), self.is_test(offset)))
        return found

    def _members(self, start, kind):
        """Fields of a struct, variants of an enum: what begins at depth one of its block."""
        opening = re.compile(r"[{;(]").search(self.code, start)
        if opening is None or opening.group() != "{":
            return []
        end = self.closing(opening.start())
        members, depth, expecting, at = [], 0, True, opening.start()
        pattern = VARIANT if kind == "enum" else FIELD
        while at < end:
            letter = self.code[at]
            if depth == 1 and expecting and not letter.isspace():
                if letter == "#":
                    at = self._after_attribute(at)
                    continue
                match = pattern.match(self.code, at)
                if match:
                    members.append((match.start(1), match.group(1)))
                    at = match.end()
                    expecting = False
                    continue
                if letter not in "}":
                    expecting = False
            if letter in "{([":
                depth += 1
            elif letter in "})]":
                depth -= 1
            elif letter == "," and depth == 1:
                expecting = True
            elif letter == "<" and kind != "enum" and depth >= 1:
                depth += 1
            elif letter == ">" and kind != "enum" and depth > 1 and self.code[at - 1] not in "-=":
                depth -= 1
            at += 1
        return members

    def _after_attribute(self, start):
        depth = 0
        for match in re.compile(r"[\[\]]").finditer(self.code, start):
            depth += 1 if match.group() == "[" else -1
            if depth == 0:
                return match.end()
        return len(self.code)

    def structs(self):
        """Every struct with braces, with the doc comment and the attributes before it."""
        lines = self.text.split("\n")
        found = []
        for match in re.finditer(r"\bstruct\s+(\w+)", self.code):
            line = self.line_of(match.start())
            first = line - 1
            while first > 0 and re.match(r"\s*(///|//!|#\[|\)\]|[\w]+\(.*\)\]?$)", lines[first - 1]):
                first -= 1
            fields = len(self._members(match.end(), "struct"))
            found.append(Struct(match.group(1), line, fields, "\n".join(lines[first:line - 1])))
        return found

    def production_lines(self):
        """Lines with code that is not a test's."""
        if self.in_tests:
            return 0
        code = list(self.code)
        for start, end in self.test_regions:
            for at in range(start, end):
                if code[at] != "\n":
                    code[at] = " "
        return sum(1 for line in "".join(code).split("\n") if line.strip())


def count(files):
    """Production lines for each crate: files are {path: text} of a whole revision."""
    crates = sorted((path[: -len("Cargo.toml")] for path in files if path.endswith("Cargo.toml")), key=len)
    sources = {path: Source(path, text) for path, text in files.items() if path.endswith(".rs")}
    test_files = set()
    for path, source in sources.items():
        stem = path[: -len(".rs")]
        folder = path.rsplit("/", 1)[0] if stem.rsplit("/", 1)[-1] in ("lib", "main", "mod") else stem
        test_files.update(f"{folder}/{module}" for module in source.test_modules)
    totals = {}
    for path, source in sources.items():
        if any(path == f"{module}.rs" or path.startswith(f"{module}/") for module in test_files):
            continue
        lines = source.production_lines()
        owner = [crate for crate in crates if path.startswith(crate)]
        name = owner[-1].rstrip("/") if owner and owner[-1] else path.split("/")[0]
        if lines:
            totals[name] = totals.get(name, 0) + lines
    return totals
