"""Equations as MathML, which browsers draw themselves: pages need no script and no network."""

import re

from docutils import nodes
from math_core import LatexToMathML

CONVERTER = LatexToMathML()
ENVIRONMENT = re.compile(r"\s*\\begin\{(equation|displaymath)(\*?)\}(.*)\\end\{\1\2\}\s*", re.DOTALL)
TAG = re.compile(r"\\tag\{([^}]*)\}")
ROW_SPACING = re.compile(r"\\\\\[[^]]*\]")
"""Extra space between rows, which the converter does not know."""


def mathml(latex, display):
    r"""MathML of one equation, and its number if `\tag` gives it one."""
    if environment := ENVIRONMENT.fullmatch(latex):
        latex = environment[3]
    tag = TAG.search(latex)
    latex = ROW_SPACING.sub(r"\\\\", TAG.sub("", latex))
    return CONVERTER.convert_with_local_state(latex, displaystyle=display), tag and tag[1]


def visit_inline(translator, node):
    """Write an equation within a line."""
    translator.body.append(mathml(node.astext(), False)[0])
    raise nodes.SkipNode


def visit_block(translator, node):
    """Write an equation of its own."""
    equation, tag = mathml(node.astext(), True)
    translator.body.append(translator.starttag(node, "div", CLASS="math-block"))
    translator.body.append(equation)
    if tag:
        translator.body.append(f'<span class="equation-number">({tag})</span>')
    translator.body.append("</div>\n")
    raise nodes.SkipNode


def setup(app):
    """Register the renderer that `html_math_renderer = "mathml"` chooses."""
    app.add_html_math_renderer("mathml", inline_renderers=(visit_inline, None), block_renderers=(visit_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
