"""Inner loops of the kinematics as machine code, pose by pose; used where the extra ``fast`` is installed.

They compute what the batched functions beside them do, with which tests compare them. Only
:mod:`.availability` may be imported where numba is not installed.
"""
