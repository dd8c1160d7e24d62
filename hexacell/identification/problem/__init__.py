"""The identification problem: records, commanded poses, prior and noise, checked."""
