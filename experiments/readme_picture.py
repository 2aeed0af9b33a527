"""The README's picture, docs/feel.svg: the weave's cross plots for every law.

python -m experiments.readme_picture
"""

from pathlib import Path

import friction
from experiments.battery import drive
from experiments.figures import cross_plots
from vehicle import cars

if __name__ == "__main__":
    car = cars.load()
    loops = {law: drive(car, friction.make(law), "weave", {"cycles": 5}).curves for law in friction.available()}
    Path("docs/feel.svg").write_text(cross_plots(loops, "lugre"), encoding="utf-8")
