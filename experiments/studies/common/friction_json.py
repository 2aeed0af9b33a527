"""The numbers of the friction study as JSON."""

import math
from typing import Any

from steer_env import friction
from steer_env.experiments.studies.common import friction_records as records
from steer_env.experiments.studies.common.friction_results import Results


def as_json(r: Results) -> dict[str, Any]:
    """The numbers of the study; null for what is not finite."""

    def finite(x: float | None) -> float | None:
        return x if x is not None and math.isfinite(x) else None

    effects = [
        {
            "factor": row.case.factor, "level": row.case.level, "test": row.test, "metric": row.metric,
            "base": finite(row.base.value), "unit": row.base.unit, "difference": finite(row.found.value),
            "half_width": finite(row.found.half_width), "share": finite(row.found.share), "real": row.found.real,
            "perception": row.found.perception.verdict, "perception_sure": row.found.perception.sure,
        }
        for row in r.effects
        if math.isfinite(row.found.value)
    ]  # fmt: skip
    judged = {
        each.law: {
            **{name: finite(getattr(each, name)) for name in ("error", "low", "high")},
            "parameters": None if each.parameters is None else friction.law.as_mapping(each.parameters),
            "undetermined": list(each.undetermined),
            "remarks": list(each.remarks),
            "alike": list(each.alike),
        }
        for each in r.judged
    }
    confused = [{**each._asdict(), "errors": {k: finite(v) for k, v in each.errors.items()}} for each in r.confusion]
    rows = {law: [row._asdict() for row in of] for law, of in r.tables.items()}
    untimed = {
        law: [
            {
                k: finite(v) if isinstance(v, float) else v
                for k, v in row.items()
                if not k.endswith(("step_ns", "per_step"))
            }
            for row in of
        ]
        for law, of in rows.items()
    }
    times = {
        law: [
            {k: row[k] for k in ("scheme", "step", "ns_per_step", "worst_step_ns")} for row in of if row["ns_per_step"]
        ]
        for law, of in rows.items()
    }
    return {
        "record": {
            "laws": judged,
            "repeatability": r.repeatability,
            "held_out": records.HELD_OUT,
            "notes": list(r.record.notes),
        },
        "steps": untimed,
        "effects": effects,
        "apart": r.apart,
        "held_torque": [each._asdict() for each in r.held],
        "driver": [each._asdict() for each in r.driven],
        "confusion": confused,
        "real_time": {"columns": times, "whole_car_ns": r.sample_ns},
    }
