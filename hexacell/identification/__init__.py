"""From records to a geometry with its covariance: what is done, in order, and where it stands.

A record is a pose of the platform at which the encoders show joint variables and the gauges a deviation
of the ball. :func:`.estimator.identify` goes through these steps:

1. ``problem/``: :meth:`.Assumptions.problem` puts the records into the mechanism's frame convention, finds
   for each the geometry that commanded it and a start pose, and adds :class:`.Prior` and :class:`.Noise`.
   :func:`.identify` refuses records that cannot determine the parameters.
2. ``solver/``: :func:`.fit_regularized` fits the model (:func:`.predict`) by Levenberg-Marquardt with the
   prior, which is released where the data determine the parameters.
3. ``data_faults/``: :func:`.select_faults` repeats the fit without records that have a fault.
4. The result is an :class:`.Identification`: parameters, covariance, tests of the residuals, data faults.

``diagnostics/`` derives from it the errors at poses, tests by further records, and whether the robot can
have been built as drawn; :mod:`.identified_zeros` takes only the zeros of the encoders from it;
:mod:`.belief` is what is known of the robot at one moment. ``docs/method.md`` gives the reasons.
"""
