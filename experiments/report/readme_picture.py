"""The README's picture, docs/feel.svg: the weave's cross plots for every law.

python -m steer_env.experiments.report.readme_picture
"""

from pathlib import Path

from steer_env import friction
from steer_env.experiments.drawing.figures import cross_plots
from steer_env.experiments.studies.battery import drive
from steer_env.vehicle import cars

if __name__ == "__main__":
    car = cars.load()
    loops = {law: drive(car, friction.make(law), "weave", {"cycles": 5}).curves for law in friction.available()}
    Path("docs/feel.svg").write_text(cross_plots(loops, "lugre"), encoding="utf-8")
