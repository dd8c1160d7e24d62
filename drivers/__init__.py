"""Device drivers: gauges, encoders, controllers, thermometers, stop input; real and simulated.

Each package has a logger of its name, and each gauge one below it (``drivers.gauges.x``): connections,
refusals and time-outs at INFO and WARNING. ``drivers.wire`` has all traffic at DEBUG. The program adds the
handlers.
"""

import logging

for _package in ("gauges", "encoders", "controllers", "thermometers", "wire"):
    logging.getLogger(f"drivers.{_package}").addHandler(logging.NullHandler())
