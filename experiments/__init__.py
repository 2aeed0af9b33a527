"""Studies, the report, training and the command line."""

if __name__ != "steer_env.experiments":
    raise ImportError("import this package as steer_env.experiments; the bare name is no longer a package of its own")
