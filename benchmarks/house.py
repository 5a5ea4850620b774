"""Size of the product and the files that one object passes: `python benchmarks/house.py`.

Prints the lines of product code (without docstrings, comments and blank lines) of each folder, and for three walks
the files whose functions receive an object: a cover from `fem_reference.press` to the factorisation, a sensor
description through `derive`, and a contact force through `Sensor.step`.  `--lines` prints the sizes only.
`--sample SEED` prints thirty docstrings and comments drawn at random, to be read without the code.
"""

from __future__ import annotations

import argparse
import ast
import io
import os
import random
import sys
import tempfile
import tokenize
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from operator import is_
from pathlib import Path
from types import FrameType

ROOT = Path(__file__).parents[1]
PACKAGES = ("meshes", "fem_reference", "fastmodel", "validation")


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


def print_sizes() -> None:
    """Code lines of every folder, package and of the whole product."""
    sizes: Counter[str] = Counter()
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            sizes[str(path.parent.relative_to(ROOT))] += count_code_lines(path.read_text())
    for folder, lines in sorted(sizes.items()):
        print(f"{lines:6d}  {folder}")
    for package in PACKAGES:
        print(f"{sum(n for folder, n in sizes.items() if folder.split('/')[0] == package):6d}  all of {package}")
    print(f"{sizes.total():6d}  product code")


@contextmanager
def list_receivers(title: str, is_wanted: Callable[[object], bool]) -> Iterator[None]:
    """Print the product's files in which a function receives a wanted object as an argument, in order of calls."""
    files: dict[str, list[str]] = {}

    def look(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event != "call" or not code.co_filename.startswith(str(ROOT)) or code.co_name.startswith("<"):
            return
        path = str(Path(code.co_filename).relative_to(ROOT))
        names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        if path.split("/", maxsplit=1)[0] in PACKAGES and any(is_wanted(frame.f_locals.get(name)) for name in names):
            functions = files.setdefault(path, [])
            if code.co_name not in functions:
                functions.append(code.co_name)

    sys.setprofile(look)
    try:
        yield
    finally:
        sys.setprofile(None)
    print(f"\n{title}: {len(files)} files")
    for path, functions in files.items():
        print(f"  {path}: {', '.join(functions)}")


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
        f"{path.relative_to(ROOT)}\n{text}"
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
        for text in find_texts(path.read_text())
    ]
    for text in random.Random(seed).sample(texts, 30):  # noqa: S311 -- a sample for readers
        print(text, end="\n\n")


def walk_cover() -> None:
    """The covers of `press`: wide and of limited size at small strain, wide at finite strain."""
    from dataclasses import replace

    import fem_reference
    from meshes import Box, Cover, Layer, Sphere
    from meshes.catalogue import ARRAYS, ASSUMED_COVER, MATERIALS

    array, wide = ARRAYS["wts-0614-34"], ASSUMED_COVER
    soft = Cover(layers=(Layer(thickness=2e-3, material=MATERIALS["dragon-skin-30"]),))
    ball, box = Sphere(radius=4e-3), Box(size=(6e-3, 6e-3, 5e-3))
    for title, cover, shape in (
        ("a wide cover from press to the factorisation", wide, ball),
        ("a cover of limited size", replace(wide, size=(24e-3, 50e-3)), ball),
        ("a wide cover at finite strain, round indenter", soft, ball),
        ("a wide cover at finite strain, flat indenter", soft, box),
    ):
        with list_receivers(title, partial(is_, cover)):
            fem_reference.press(cover, array, shape, depth=0.2e-3)


def walk_sensor() -> None:
    """The sensor description of `derive`."""
    from validation.derivation.derive import derive
    from validation.sensor_file import load

    sensor = load("wts-0614-34")
    with list_receivers("a sensor through derive", partial(is_, sensor)):
        derive(sensor)


def walk_force() -> None:
    """Contact forces of `Sensor.step`: every file whose functions run in a step that ends with a frame."""
    import mujoco

    import fastmodel

    for method in ("cover", "boxes"):
        spec = mujoco.MjSpec()
        ball = spec.worldbody.add_body(pos=[0, 0, 0.006])
        ball.add_freejoint()
        ball.add_geom(size=[0.005, 0, 0], mass=0.5)
        sensor = fastmodel.attach(spec, "world", fastmodel.load("wts-0614-34"), contact=method)
        fastmodel.recommend_options(spec)
        model = spec.compile()
        data = mujoco.MjData(model)
        sensor.bind(model)
        for _ in range(300):
            mujoco.mj_step(model, data)
            sensor.step(data)
        with list_receivers(f"every file that runs in Sensor.step, method {method}", lambda _: True):
            for _ in range(5):
                data.qpos[0] += 1e-4
                mujoco.mj_step(model, data)
                sensor.step(data)
            sensor.frame()


def main() -> None:
    """Parse the options and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lines", action="store_true", help="print sizes only")
    parser.add_argument("--sample", type=int, metavar="SEED", help="print thirty docstrings and comments")
    options = parser.parse_args()
    if options.sample is not None:
        print_sample(options.sample)
        return
    print_sizes()
    if not options.lines:
        with tempfile.TemporaryDirectory() as store:
            os.environ["SOFTCOVER_STORE"] = store
            walk_cover()
            walk_sensor()
            walk_force()


if __name__ == "__main__":
    main()
