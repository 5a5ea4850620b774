"""The pages of the documentation: their blocks run and assert numbers, their links lead somewhere."""

from __future__ import annotations

import re
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest

from tests.support.pages import DOCS, PAGES, ROOT, list_blocks, load_script, run_page
from validation.cli.entry import app
from validation.regression.quantities import EXPERIMENTS

#: Languages of blocks that are no code: results, file formats, directives of the site.
NO_CODE = {"", "text", "toml", "sh notest", "{toctree}", "{eval-rst}"}
RUNNING = [page for page in PAGES if any(language in {"python", "sh"} for language, _ in list_blocks(page))]
#: Pages that run within a second or two; the slow tests run the others.
QUICK = {"how-to/electronics.md"}


def name(page):
    return str(page.relative_to(DOCS))


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, id=name(page), marks=() if name(page) in QUICK else pytest.mark.slow) for page in RUNNING],
)
def test_a_page_runs_from_its_first_block_to_its_last(page, tmp_path):
    done = run_page(page, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "OptionWarning" not in done.stderr


def test_the_page_on_robots_runs_as_pasted():
    """Its blocks need nothing but the blocks above them that a reader sees."""
    assert "<!-- test" not in (DOCS / "how-to" / "robots.md").read_text()


@pytest.mark.parametrize("page", RUNNING, ids=name)
def test_a_page_with_code_asserts_or_shows_a_number(page):
    blocks = list_blocks(page)
    asserts = any(re.search(r"assert.*\d", code) for language, code in blocks if language == "python")
    pairs = pairwise(blocks)
    assert asserts or any(
        a in {"python", "sh"} and b == "text" and re.search(r"\d", code) for (a, _), (b, code) in pairs
    )


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_block_is_run_or_is_no_code(page):
    for language, code in list_blocks(page):
        assert language in NO_CODE | {"python", "sh"} or language.startswith("file "), (language, code)
        if language == "toml" or (language.startswith("file ") and language.endswith(".toml")):
            tomllib.loads(code)
        if language in {"", "text"}:
            assert not re.search(r"^(import|from) ", code, flags=re.MULTILINE), code


@pytest.mark.parametrize("page", [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"], ids=lambda page: page.name)
def test_links_lead_to_files_and_headings(page):
    text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith("https://"):
            continue
        file, _, anchor = target.partition("#")
        path = (page.parent / file).resolve() if file else page
        assert path.exists(), target
        assert not anchor or anchor in list_anchors(path), target


def list_anchors(path: Path):
    text = path.read_text()
    titles = re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE)
    slugs = {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}
    return slugs | set(re.findall(r"^\((.+)\)=$", text, flags=re.MULTILINE))


def test_every_page_is_in_the_contents():
    listed = {line for _, code in list_blocks(DOCS / "index.md") for line in code.splitlines() if line}
    assert {name(page).removesuffix(".md") for page in PAGES} - {"index"} <= listed


@pytest.mark.parametrize("name", ["regression.md", "regress.yml"])
def test_commands_of_the_regression_check_are_accepted(name):
    lines = re.findall(r"softcover (regress sensor\S* [^#\n]*)", (DOCS / name).read_text())
    assert len(lines) >= 2
    for line in lines:
        command, bound, _ = app.parse_args(line.split(), exit_on_error=False, print_error=False)
        assert command.__name__ == "regress"
        assert bound.arguments["baseline"] == Path("sensor.baseline.json")


def test_every_group_of_the_regression_check_is_explained():
    text = (DOCS / "regression.md").read_text()
    rows = re.findall(r"^\| (`.*?`) \|", text, flags=re.MULTILINE)
    assert {name for row in rows for name in re.findall(r"`(.*?)`", row)} == set(EXPERIMENTS)


def test_the_table_of_times_shows_every_command_that_is_measured():
    text = (DOCS / "how-to" / "how-long.md").read_text()
    for what, command in load_script("how_long").COMMANDS:
        assert f"| {what} | `softcover {command}` | " in text


def test_the_table_of_sizes_has_every_extra():
    table = (DOCS / "installation.md").read_text().partition("<!-- sizes: begin -->")[2]
    stated = re.findall(r"^\| (?:`(\w+)`|\(base\)) ", table, re.MULTILINE)
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert sorted(stated) == sorted(["", *extras])


def list_install_lines():
    """Every text of the repository that installs softcover by name, with its place."""
    for folder in (
        "README.md",
        "CONTRIBUTING.md",
        "docs",
        "examples",
        "meshes",
        "fem_reference",
        "fastmodel",
        "validation",
    ):
        root = ROOT / folder
        for path in [root] if root.is_file() else sorted(root.rglob("*")):
            if path.suffix in {".py", ".md", ".yml", ".toml", ".j2"}:
                for line in path.read_text().splitlines():
                    if re.search(r"pip install (-\S+ )*['\"]?softcover\b|['\"]softcover\[", line):
                        yield f"{path.relative_to(ROOT)}: {line.strip()}"


def test_no_line_installs_from_an_index_that_does_not_have_the_package():
    assert list(list_install_lines()) == []


def test_the_map_of_the_code_names_every_folder_and_no_other():
    text = (ROOT / "CONTRIBUTING.md").read_text().split("## Where things are")[1].split("```")[1]
    named, package = set(), ""
    for line in text.strip().splitlines():
        folder = line.split()[0].rstrip("/")
        package = package if line.startswith(" ") else folder
        named.add(Path(package) / folder if line.startswith(" ") else Path(folder))
    packages = ("meshes", "fem_reference", "fastmodel", "validation")
    files = (path.relative_to(ROOT) for package in packages for path in (ROOT / package).glob("*/**/*.*"))
    folders = {Path(*path.parts[:2]) for path in files if "__pycache__" not in path.parts}
    assert {each for each in named if each.parent != Path()} == folders
