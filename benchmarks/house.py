"""Structure of the code: `python benchmarks/house.py`.

`--lines` prints code lines (without docstrings, comments and blank lines) of each folder, of product, tests and
benchmarks; templates, TOML, CSS and JavaScript of the packages count as well.  `--constants` counts numeric constants
of modules.  `--covers` lists the places that ask what kind of cover, solid, pose or press they have.  `--sample SEED`
prints thirty docstrings and comments drawn at random, to be read without the code.  Without options it prints the first
three, without the list.
"""

from __future__ import annotations

import argparse
import ast
import io
import random
import re
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("meshes", "fem_reference", "fastmodel", "validation")
#: Endings of files that hold code or text of the product in other languages.
OTHER_LANGUAGES = (".j2", ".css", ".js", ".toml")
#: Names that a branch on the kind of cover mentions, and classes that it asks for.
COVER_NAMES = re.compile(r"curved|\.body\b|\bplanar\b|is_solid")
COVER_CLASSES = re.compile(r"\b(\w*Cover|SolidMesh|\w*Pose|Touch|Curved\w+|CoverCells)\b")
#: The modules of the cover classes themselves, where the question may be answered.
COVER_MODULES = ("meshes/cover.py", "meshes/solids/cover.py", "fastmodel/surface.py")


def list_sources(*folders: str) -> Iterator[tuple[Path, str]]:
    """Every Python file of some folders, with its text."""
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("*.py")):
            yield path, path.read_text()


def count_code_lines(source: str) -> int:
    """Lines of a source that are neither docstring, comment nor blank."""
    documented: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and ast.get_docstring(
            node, clean=False
        ):
            text = node.body[0]
            documented |= set(range(text.lineno, (text.end_lineno or text.lineno) + 1))
    lines = enumerate(source.splitlines(), start=1)
    return sum(bool(text := line.strip()) and text[0] != "#" and i not in documented for i, line in lines)


def count_lines(path: Path) -> int:
    """Code lines of a Python file, else the lines that are not blank; shipped parameters of sensors are none."""
    if path.suffix in {".py", ".pyi"}:
        return count_code_lines(path.read_text())
    if path.suffix in OTHER_LANGUAGES and "sensors" not in path.parts:
        return sum(bool(line.strip()) for line in path.read_text().splitlines())
    return 0


def print_sizes() -> None:
    """Code lines of every folder, package, of the whole product, and of tests and benchmarks."""
    sizes: Counter[str] = Counter()
    for package in (*PACKAGES, "tests", "benchmarks"):
        for path in sorted((ROOT / package).rglob("*")):
            if path.is_file():
                sizes[str(path.parent.relative_to(ROOT))] += count_lines(path)
    for folder, lines in sorted(sizes.items()):
        if lines and not folder.startswith("tests/"):
            print(f"{lines:6d}  {folder}")
    whole: Counter[str] = Counter()
    for folder, lines in sizes.items():
        whole[folder.split("/", maxsplit=1)[0]] += lines
    for name, lines in whole.items():
        print(f"{lines:6d}  all of {name}")
    print(f"{sum(whole[name] for name in PACKAGES):6d}  product code")


def find_constants(source: str) -> Iterator[str]:
    """Names of numeric constants of a module: assignments of numbers, or of tuples of numbers, at its top level."""
    for node in ast.parse(source).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        for target in targets:
            pairs = [(target, node.value)]
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs = list(zip(target.elts, node.value.elts, strict=False))
            for name, value in pairs:
                if isinstance(name, ast.Name) and is_numeric(value):
                    yield name.id


def is_numeric(value: ast.expr) -> bool:
    """Whether an expression holds nothing but numbers, in tuples and dictionaries as well."""
    allowed = (
        ast.BinOp, ast.UnaryOp, ast.operator, ast.unaryop, ast.Tuple, ast.List, ast.Dict, ast.Attribute, ast.Name,
        ast.Load, ast.Call, ast.Constant,
    )  # fmt: skip
    nodes = list(ast.walk(value))
    numbers = [n for n in nodes if isinstance(n, ast.Constant) and type(n.value) in {int, float}]
    called = {ast.unparse(n.func) for n in nodes if isinstance(n, ast.Call)}
    names = {n.id for n in nodes if isinstance(n, ast.Name)}
    known = called <= {"np.radians", "math.radians", "np.sqrt", "math.sqrt"} and names <= {"np", "math"}
    return bool(numbers) and all(isinstance(n, allowed) for n in nodes) and known


def find_cover_questions(source: str) -> Iterator[tuple[int, str]]:
    """Places of a source that ask for the kind of cover: tests of branches, `isinstance`, `hasattr`, twin functions."""
    tree = ast.parse(source)
    functions = {n.name for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.ClassDef)}
    for node in ast.walk(tree):
        if isinstance(node, ast.If | ast.IfExp | ast.While) or (isinstance(node, ast.comprehension) and node.ifs):
            tests = node.ifs if isinstance(node, ast.comprehension) else [node.test]
            for test in tests:
                text = ast.unparse(test)
                asks = "isinstance" in text or "hasattr" in text or "getattr" in text
                if COVER_NAMES.search(text) or (asks and COVER_CLASSES.search(text)):
                    yield test.lineno, text
        elif isinstance(node, ast.match_case) and COVER_CLASSES.search(ast.unparse(node.pattern)):
            yield node.pattern.lineno, f"case {ast.unparse(node.pattern)}"
        elif isinstance(node, ast.FunctionDef) and "curved" in node.name:
            twin = re.sub(r"_?curved_?", "_", node.name).strip("_")
            yield node.lineno, f"def {node.name}" + (f", twin of {twin}" if twin in functions else "")


def print_cover_questions(*, listed: bool) -> None:
    """Count, and list if wanted, the places outside the cover classes that ask for the kind of cover."""
    found = [
        f"{path.relative_to(ROOT)}:{line}: {text}"
        for path, source in list_sources(*PACKAGES)
        if str(path.relative_to(ROOT)) not in COVER_MODULES
        for line, text in find_cover_questions(source)
    ]
    if listed:
        print("\n".join(found))
    print(f"{len(found):6d}  places that ask for the kind of cover")


def print_constants() -> None:
    """Count numeric constants of modules by package."""
    counts = {name: sum(len(list(find_constants(text))) for _, text in list_sources(name)) for name in PACKAGES}
    for name, count in counts.items():
        print(f"{count:6d}  numeric constants in {name}")
    print(f"{sum(counts.values()):6d}  numeric constants")


def find_texts(source: str) -> Iterator[str]:
    """Docstrings and blocks of comments of a source."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and (
            text := ast.get_docstring(node)
        ):
            yield f"{getattr(node, 'name', '(module)')}: {text}"
    block: list[str] = []
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    for token in tokens:
        if token.type == tokenize.COMMENT and not token.string.startswith(("# noqa", "# type:", "# pragma")):
            block.append(f"{token.string}    <- {token.line.split('#')[0].strip()}".removesuffix("    <- "))
        elif block and token.type not in {tokenize.NL, tokenize.COMMENT}:
            yield "\n".join([*block, token.line.strip()])
            block = []


def print_sample(seed: int) -> None:
    """Thirty docstrings and comments of the product, drawn at random."""
    texts = [
        f"{path.relative_to(ROOT)}\n{text}" for path, source in list_sources(*PACKAGES) for text in find_texts(source)
    ]
    for text in random.Random(seed).sample(texts, 30):  # noqa: S311 -- a sample for readers
        print(text, end="\n\n")


def main() -> None:
    """Parse the options and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lines", action="store_true", help="print code lines by folder")
    parser.add_argument("--constants", action="store_true", help="count numeric constants of modules")
    parser.add_argument("--covers", action="store_true", help="list places that ask for the kind of cover")
    parser.add_argument("--sample", type=int, metavar="SEED", help="print thirty docstrings and comments")
    options = parser.parse_args()
    if options.sample is not None:
        print_sample(options.sample)
        return
    everything = not (options.lines or options.constants or options.covers)
    if options.lines or everything:
        print_sizes()
    if options.constants or everything:
        print_constants()
    if options.covers or everything:
        print_cover_questions(listed=options.covers)


if __name__ == "__main__":
    main()
