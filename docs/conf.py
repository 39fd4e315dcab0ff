"""Sphinx configuration. Everything numeric on the pages comes from cells that run at build."""

from __future__ import annotations

import os
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
for _folder in (ROOT, HERE / "_ext"):
    sys.path.insert(0, str(_folder))
# Cells see the same modules as this file does.
os.environ["PYTHONPATH"] = os.pathsep.join([*sys.path[:2], os.environ.get("PYTHONPATH", "")])

import dataset_pages  # noqa: E402
import docstring_rules  # noqa: E402
import flag_table  # noqa: E402
import gallery_pages  # noqa: E402
import measured_numbers  # noqa: E402
import public_names  # noqa: E402
import related  # noqa: E402
import student_copy  # noqa: E402

import ctrl_realize  # noqa: E402

project = "ctrl_realize"
author = "the ctrl_realize developers"
copyright = "2026, the ctrl_realize developers"
version = release = ctrl_realize.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "myst_nb",
    "sphinx_copybutton",
    "mathml",
    "glossary_links",
    "breakable",
    "figures",
    "entries",
]
# Tables are parts of pages, but for the one that is a page of its own.
PARTS = [f"tables/{path.name}" for path in sorted((HERE / "tables").glob("*_table.md"))]
PARTS.remove("tables/defects_table.md")
exclude_patterns = [
    "_build",
    "_ext",
    "**/.ipynb_checkpoints",
    *PARTS,
    "generated/tables",
    "generated/course",
]
templates_path = ["_templates"]
root_doc = "index"

# -- what is written before the build ------------------------------------------------------------

GENERATED = HERE / "generated"
GENERATED.mkdir(exist_ok=True)
public_names.write_pages(GENERATED / "api")
LABORATORY = "13_dead_time_laboratory.ipynb"
student_copy.write(ROOT / "notebooks" / LABORATORY, GENERATED / "course" / LABORATORY)
if not tags.has("without_gallery"):  # noqa: F821 - Sphinx brings `tags`; `-t without_gallery`
    gallery_pages.write(HERE / "gallery", GENERATED / "gallery", ROOT / "ctrl_realize")


def _notebooks_into_source() -> None:
    """Show the notebooks' folder to Sphinx, which reads nothing outside of its own."""
    link = GENERATED / "notebooks"
    if not link.exists():
        link.unlink(missing_ok=True)
        link.symlink_to(Path("..") / ".." / "notebooks", target_is_directory=True)


_notebooks_into_source()

# Tables that the benchmarks write, or a line that says how to make them.
TABLES = {
    "performance": ("docs/tables/performance_table.md", "python -m benchmarks.speed"),
    "accuracy": ("docs/tables/accuracy_table.md", "python -m benchmarks.accuracy"),
    "honesty": ("docs/tables/honesty_table.md", "python -m benchmarks.honesty"),
    "worlds": ("docs/tables/worlds_table.md", "python -m benchmarks.worlds"),
    "verdicts": (
        "docs/tables/verdicts_table.md",
        "python -m benchmarks.verdicts --table docs/tables/verdicts_table.md",
    ),
    "several": ("docs/tables/several_table.md", "python -m benchmarks.records several"),
    "statements": ("docs/tables/statements_table.md", "python -m benchmarks.records statements"),
    "experiment": (
        "docs/tables/experiment_table.md",
        "python -m benchmarks.experiment --table docs/tables/experiment_table.md",
    ),
    "kernels": ("docs/tables/kernels_table.md", "python -m benchmarks.kernels"),
    "ablation": ("docs/tables/ablation_table.md", "python -m benchmarks.ablation"),
    "ablation_worlds": (
        "docs/tables/ablation_worlds_table.md",
        "python -m benchmarks.ablation --made-for 6",
    ),
    "ablation_measured": (
        "docs/tables/ablation_measured_table.md",
        "python -m benchmarks.ablation --kinds measured --only ... "
        "--output docs/tables/ablation_measured_table.md",
    ),
    "ablation_slow_noise": (
        "docs/tables/ablation_slow_noise_table.md",
        "python -m benchmarks.ablation --made-for 24 --only ... "
        "--output docs/tables/ablation_slow_noise_table.md",
    ),
    "ablation_loop": (
        "docs/tables/ablation_loop_table.md",
        "python -m benchmarks.ablation --made-for 24 --only held loop 'behind rounding' "
        "--output docs/tables/ablation_loop_table.md",
    ),
    "textbook": ("docs/tables/textbook_table.md", "python -m benchmarks.loops.textbook"),
    "kinds": ("docs/tables/kinds_table.md", "python -m benchmarks.records kinds"),
    "verdicts_measured": (
        "docs/tables/verdicts_measured_table.md",
        "python -m benchmarks.verdicts --measured ... "
        "--table docs/tables/verdicts_measured_table.md",
    ),
    "campaign": (
        "docs/tables/campaign_table.md",
        "python -m benchmarks.campaign --output docs/tables/campaign_table.md",
    ),
    "closed_loop": (
        "docs/tables/closed_loop_table.md",
        "python -m benchmarks.closed_loop --store loops.jsonl --table "
        "docs/tables/closed_loop_table.md",
    ),
    "acceptance": (
        "docs/tables/acceptance_table.md",
        "python -m benchmarks.acceptance --store acceptance.jsonl --table "
        "docs/tables/acceptance_table.md",
    ),
    "factors": (
        "docs/tables/factors_table.md",
        "python -m benchmarks.accuracy.factors --store factors.jsonl --table "
        "docs/tables/factors_table.md",
    ),
    "relay": (
        "docs/tables/relay_table.md",
        "python -m benchmarks.relay --store relay.jsonl --output docs/tables/relay_table.md",
    ),
    "app": ("docs/tables/app_table.md", "python -m benchmarks.app"),
    "missing": ("docs/tables/missing_table.md", "python -m benchmarks.accuracy.missing"),
    "loops": ("docs/tables/loops_table.md", "python -m benchmarks.loops"),
    "fuzz": ("docs/tables/fuzz_table.md", "python3 tools/fuzz_table.py"),
    "peers": ("docs/tables/peers_table.md", "python -m benchmarks.peers simulated"),
    "crossed": ("docs/tables/crossed_table.md", "python -m benchmarks.peers crossed"),
    "joint": ("docs/tables/joint_table.md", "python -m benchmarks.peers joint"),
    "peers_measured": (
        "docs/tables/peers_measured_table.md",
        "python -m benchmarks.peers measured",
    ),
}
(GENERATED / "tables").mkdir(exist_ok=True)
for _name, (_file, _command) in TABLES.items():
    _stored = ROOT / _file
    _text = (
        _stored.read_text()
        if _stored.exists()
        else f"*No table is stored yet; `{_command}` makes it.*\n"
    )
    # What stands under headings of its own goes where the page wants it.
    _first, _heading, _rest = _text.partition("\n### ")
    (GENERATED / "tables" / f"{_name}.md").write_text(_first)
    _more = (_heading.lstrip("\n") + _rest).replace("### ", "## ")
    (GENERATED / "tables" / f"{_name}_more.md").write_text(_more)
(GENERATED / "tables" / "flags.md").write_text(flag_table.table(ROOT / "ctrl_realize"))
(GENERATED / "tables" / "datasets.md").write_text(dataset_pages.page())

# -- notebooks and code cells --------------------------------------------------------------------

# Sharp figures, whatever the reader's own IPython is set to.
PROFILE = HERE / "_build" / "ipython"
(PROFILE / "profile_default").mkdir(parents=True, exist_ok=True)
(PROFILE / "profile_default" / "ipython_kernel_config.py").write_text(
    'c = get_config()\nc.InlineBackend.figure_formats = {"retina"}\n'
    "c.HistoryManager.enabled = False\n"
)
os.environ["IPYTHONDIR"] = str(PROFILE)
os.environ.pop("MPLBACKEND", None)  # the kernel brings its own
for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(threads, "1")

nb_execution_mode = "force"
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True
nb_ipywidgets_js = {}  # sliders live in Jupyter; a page asks no network
nb_code_prompt_show = "Show this code"
nb_code_prompt_hide = "Hide this code"
suppress_warnings = ["mystnb.unknown_mime_type"]

myst_enable_extensions = [
    "dollarmath",
    "amsmath",
    "deflist",
    "colon_fence",
    "smartquotes",
    "substitution",
]
myst_substitutions = measured_numbers.numbers(HERE)
myst_heading_anchors = 3
html_math_renderer = "mathml"

# -- API reference -------------------------------------------------------------------------------

autosummary_generate = True
autosummary_context = {"related": related.sections()}
autosummary_imported_members = True
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
numpydoc_validation_checks = docstring_rules.CHECKS
numpydoc_validation_exclude = {docstring_rules.CONSTANTS}
default_role = "code"
nitpicky = True
# Bases that a class shows: their pages are elsewhere, Python's too, and a build asks no network.
nitpick_ignore = [
    ("py:class", "control.statesp.StateSpace"),
    ("py:class", "control.frdata.FrequencyResponseData"),
    ("py:class", "abc.ABC"),
]

# -- look ----------------------------------------------------------------------------------------

html_theme = "furo"
pygments_dark_style = "github-dark"
html_title = "ctrl_realize"
html_static_path = ["_static"]
html_extra_path = ["extra", "../ctrl_realize/report/identification.schema.json"]
html_css_files = ["style.css"]
html_js_files = ["figures.js", "front.js"]
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "light_css_variables": {
        "color-brand-primary": "#0060a0",
        "color-brand-content": "#0060a0",
        "font-stack": "system-ui, -apple-system, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif",
        "font-stack--monospace": "ui-monospace, 'SF Mono', Menlo, 'DejaVu Sans Mono', monospace",
    },
    "dark_css_variables": {
        "color-brand-primary": "#6cb6ff",
        "color-brand-content": "#6cb6ff",
    },
}
copybutton_exclude = ".linenos, .gp, .go"
