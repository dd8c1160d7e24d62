"""Device drivers: gauges, encoders, controllers, thermometers, stop input; real and simulated."""
