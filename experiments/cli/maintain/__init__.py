"""For maintainers: requirements, scores, audit, baselines, reference pages."""

GROUP = "maintain"
