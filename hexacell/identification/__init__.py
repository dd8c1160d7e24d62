"""From records to a geometry with its covariance: what is done, in order, and where it stands.

A record is a pose of the platform at which the encoders show joint variables and the gauges a deviation
of the ball. :func:`.estimator.identify` goes through these steps:

1. ``problem/``: :meth:`.Assumptions.problem` puts the records into the mechanism's frame convention,
   finds for each the geometry that commanded it and a pose at which the solver starts, and adds what is
   known beforehand (:class:`.Prior`, :class:`.Noise`). :func:`.require_enough_records` and
   :func:`.require_rotation_diversity` refuse records that cannot determine the parameters.
2. ``solver/``: :func:`.fit_regularized` fits them: Levenberg-Marquardt with the prior, which is released
   where the data determine the parameters (:mod:`.solver.fit` is the page from which one iteration is
   understood). The model is :func:`.predict`; :class:`.NuisanceElimination` removes the unknowns of the
   stations.
3. ``data_faults/``: :func:`.screen` repeats the fit without records that have a fault. Stepwise selection
   (:mod:`.stepwise_selection`) takes :mod:`.hypotheses` by :mod:`.score_tests` forward, by trial refits
   where a fit is unreliable (:mod:`.trial_fits`), and gives records back by
   :mod:`.deletion_tests`. The words are added at the end (:mod:`.messages`).
4. The result is an :class:`.Identification`: parameters, covariance, tests of the residuals, data faults.

Besides, ``diagnostics/`` derives from a result what errors it leaves at poses, whether the model predicts
records that it was not fitted to, and whether the robot can have been built as drawn;
:mod:`.identified_zeros` takes only the zeros of the encoders from it; :mod:`.belief` is what is known of
the robot at one moment.
"""
