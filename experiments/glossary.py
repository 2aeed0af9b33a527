"""Every test and metric as a page, docs/metrics.md, drawn from the one place that defines them.

python -m experiments.glossary
"""

from pathlib import Path

from steer_env import manoeuvres, metrics

PATH = Path(__file__).parents[1] / "docs" / "metrics.md"
_HEAD = """# Tests and metrics

Written by `python -m experiments.glossary` from the definitions in `steer_env/manoeuvres/` and `steer_env/metrics/`; no
conformance with any standard is claimed. A value is the mean over the repeats of a recording (cycles, steps, sweeps,
segments), with a 95 % interval where there are several. What a recording cannot carry is refused with a reason. Usual
ranges are for passenger cars, engineering judgement.
"""


def page() -> str:
    """The page as Markdown."""
    parts = [_HEAD]
    for test in metrics.tests():
        about = manoeuvres.make(test) if test in manoeuvres.available() else None
        parts.append(f"\n## {test}\n")
        if about:
            parts.append(f"{about.definition} {about.source[0].upper()}{about.source[1:]}.\n")
        parts.append("| metric | unit | definition | usual | source |\n|---|---|---|---|---|")
        for name in metrics.available(test):
            entry = metrics.definition(name)
            usual = f"{entry.usual[0]:g} to {entry.usual[1]:g}" if entry.usual and test == "weave" else ""
            text = entry.definition.replace("+-", "±").replace("|", "\\|")
            parts.append(f"| `{name}` | {entry.unit} | {text} | {usual} | {entry.source} |")
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    PATH.write_text(page(), encoding="utf-8")
