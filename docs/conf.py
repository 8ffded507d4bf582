"""Configuration of the documentation: `sphinx-build -W --keep-going -b html docs docs/_build/html`."""

import dataclasses
import importlib
import os
import pkgutil
import re
import subprocess
import sys
from importlib.metadata import version as installed
from pathlib import Path

import scipy.stats  # noqa: F401  before torch is mocked: scipy would take the mock for an array library
from sphinx.ext import autodoc, autosummary

os.environ["NUMBA_DISABLE_JIT"] = "1"  # compiled kernels are documented as the functions that they are
HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE)]  # vehicle_models and studies; the extension mathml

import exumob  # noqa: E402  after the switch of Numba
from exumob.support.declared import Declared, declared_fields  # noqa: E402
from exumob.support.quantities import shown  # noqa: E402

LONGEST_VALUE = 200
"""Longest value of a constant that is shown [characters]."""

project = "exumob"
author = "The exumob developers"
copyright = author
version = release = installed("exumob")

extensions = [
    "mathml",
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
]
exclude_patterns = ["_build", "_generated/*.md", "_static"]
html_math_renderer = "mathml"
smartquotes = False  # they would turn the -- of options into dashes
html_theme = "furo"
html_title = f"exumob {release}"
html_static_path = ["_static"]
html_css_files = ["custom.css"]
html_show_copyright = False

myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
myst_dmath_double_inline = True

default_role = "py:obj"
autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_typehints = "none"  # in the signature they repeat the docstring
autodoc_preserve_defaults = True
autodoc_mock_imports = ["torch"]  # not needed to read docstrings
autosummary_generate = True  # a page a module, found in the folders: no page names files
templates_path = ["_templates"]
toc_object_entries_show_parents = "hide"
suppress_warnings = ["ref.python"]  # a short name that several modules use

autosummary.WELL_KNOWN_ABBREVIATIONS += ("Eq.", "Eqs.", "Sec.", "Secs.", "Fig.", "Figs.")  # end no summary
whole_value = autodoc.object_description
autodoc.object_description = lambda value, **how: (
    text if len(text := whole_value(value, **how)) <= LONGEST_VALUE else "..."
)

napoleon_google_docstring = False
napoleon_numpy_docstring = True
napoleon_use_ivar = True
napoleon_use_rtype = False

PAGES = {
    "benchmarks/openfoam/README.md": "/project/openfoam.md",
    "data/cfd_mbd/README.md": "/project/dataset.md",
    "CONTRIBUTING.md": "/project/contributing.md",
    "CHANGELOG.md": "/project/changelog.md",
}
"""Files of the repository that are pages here."""


def plain_docstrings(app, what, name, obj, options, lines):
    """Docstrings are written for the reader of the source: make reStructuredText of what would not be any.

    Bars are absolute values, not substitutions. An indented block after a colon is literal, and so is any indented
    block within a paragraph of a module's docstring, which has no sections.
    """
    out = []
    literal = None  # indent of the line before a literal block
    for n, line in enumerate(lines):
        indent = len(line) - len(line.lstrip())
        if literal is not None and line.strip() and indent <= literal:
            if out[-1].strip():
                out.append("")
            literal = None
        if literal is None and "``" not in line:
            line = re.sub(r"(?<![\\`])\|", r"\\|", line)
        out.append(line)
        text = line.rstrip()
        if literal is not None or not text or text.lstrip().startswith(("- ", "* ", "..")):
            continue
        following = [other for other in lines[n + 1 :] if other.strip()]
        if not following or len(following[0]) - len(following[0].lstrip()) <= indent:
            continue
        if text.endswith("::"):
            literal = indent
        elif text.endswith(":"):
            out[-1:] = [text + ":", ""]
            literal = indent
        elif what == "module" and lines[n + 1].strip():
            out += ["", " " * indent + "::", ""]
            literal = indent
    if what in ("attribute", "data", "property"):
        out[:0] = ["..", ""]  # else napoleon takes what stands before a colon for a type
    lines[:] = out


def repository_links(app, relative_path, parent, content):
    """Links of a file of the repository as seen from the documentation; those to other such files lead to its pages."""
    folder = (Path(app.srcdir) / relative_path).resolve().parent
    if folder.is_relative_to(HERE):
        return

    def moved(match):
        words, target = match.groups()
        place = (folder / target).resolve()
        page = PAGES.get(place.relative_to(HERE.parent).as_posix())
        if page is not None:
            return f"{words}({page})"
        if place.suffix == ".md" or not place.is_file():
            return words.strip("[]")
        return f"{words}(/../{place.relative_to(HERE.parent).as_posix()})"

    content[0] = re.sub(r"(!?\[[^\]]*\])\(([^)#:\s]+)\)", moved, content[0])


def forget_moved_modules(app, config):
    """Remove the generated pages if a module of theirs is gone, before autosummary reads the lists in them."""
    pages = list((HERE / "_generated" / "api").glob("*.rst"))
    places = [HERE.parent / page.stem.replace(".", "/") for page in pages]
    if not all(place.is_dir() or place.with_suffix(".py").is_file() for place in places):
        for page in pages:
            page.unlink()


def exported_names(app):
    """Write the tables of what packages export, with links to the modules where that is defined."""
    for package in ("exumob", "exumob.towing_tank", "exumob.flow", "exumob.sweeps"):
        module = importlib.import_module(package)
        objects = [getattr(module, name) for name in module.__all__ if not name.startswith("_")]
        names = [f"   ~{thing.__module__}.{thing.__qualname__}" for thing in objects]
        write_if_changed(
            f"exported_{package}.md", "\n".join(["```{eval-rst}", ".. autosummary::", "", *names, "```", ""])
        )


limits = {}
"""Unit and limits of all declared fields; kept before autodoc changes the annotations of the classes."""


def declared_classes():
    """All classes of the package whose fields are declared, by module."""
    for module in pkgutil.walk_packages(exumob.__path__, "exumob."):
        if module.name.startswith(("exumob.commands", "exumob.learning.torch_networks")):
            continue
        for thing in vars(importlib.import_module(module.name)).values():
            public = isinstance(thing, type) and thing.__module__ == module.name and not thing.__name__.startswith("_")
            if public and issubclass(thing, Declared) and thing is not Declared:
                yield thing


def limits_of(quantity):
    """Unit and limits of a declared number, in words."""
    if quantity is None:
        return ""
    between = "" if quantity.plausible is None else "plausible {:.6g} to {:.6g}".format(*quantity.plausible)
    return "; ".join(part for part in (quantity.unit, quantity.bounds, between) if part)


def parameter_tables(app):
    """Write the tables of all parameters as the declarations say them: unit, limits, plausible range, default."""
    lines = []
    for owner in declared_classes():
        lines += ["", f"## {owner.__name__}", "", f"{{py:obj}}`{owner.__module__}.{owner.__name__}`", ""]
        lines += ["| field | unit | must be | plausible | default | meaning |", "|---|---|---|---|---|---|"]
        for field in declared_fields(owner):
            quantity = field.quantity
            limits[f"{owner.__module__}.{owner.__qualname__}.{field.name}"] = limits_of(quantity)
            needed = field.default is dataclasses.MISSING
            value = f"{field.default:.6g}" if isinstance(field.default, float) else shown(field.default, 24)
            default = "needed" if needed else f"`{value}`" if field.default != "" else ""
            between = "" if not quantity or not quantity.plausible else "{:.6g} to {:.6g}".format(*quantity.plausible)
            cells = (
                f"`{field.name}`", quantity.symbol if quantity else "", quantity.bounds if quantity else "", between,
                default, " ".join(field.meaning.split()),
            )  # fmt: skip
            row = [
                cell.replace("|", "\\|").replace("<", "\\<").replace("_", "\\_")
                if "`" not in cell
                else cell.replace("|", "\\|")
                for cell in cells
            ]
            lines.append(f"| {' | '.join(row)} |")
    write_if_changed("parameters.md", "\n".join([*lines, ""]))


def declared_limits(app, what, name, obj, options, lines):
    """Say unit and limits of a declared field below its text."""
    if what == "attribute" and limits.get(name):
        lines += ["", f"[{limits[name]}]", ""]


def write_if_changed(name, text):
    """Write a generated page, but only where it is new, so that sphinx reads again only what has changed."""
    target = HERE / "_generated" / name
    target.parent.mkdir(exist_ok=True)
    if not target.exists() or target.read_text() != text:
        target.write_text(text)


def command_line_reference(app):
    """Write the pages of all commands as typer gives them, so that they are those of the program."""
    call = [sys.executable, "-m", "typer", "exumob.__main__", "utils", "docs", "--name", "exumob"]
    found = subprocess.run(
        call, capture_output=True, text=True, check=True, cwd=HERE.parent, env=os.environ | {"NO_COLOR": "1"}
    )  # fmt: skip
    text = found.stdout.partition("\n")[2]  # the page has its own title
    write_if_changed("commands.md", text)


def setup(app):
    """Docstrings are mended before napoleon, which has the priority 500, reads them."""
    app.connect("config-inited", forget_moved_modules)
    app.connect("builder-inited", command_line_reference)
    app.connect("builder-inited", exported_names)
    app.connect("builder-inited", parameter_tables)
    app.connect("include-read", repository_links)
    app.connect("autodoc-process-docstring", declared_limits, priority=300)
    app.connect("autodoc-process-docstring", plain_docstrings, priority=400)
