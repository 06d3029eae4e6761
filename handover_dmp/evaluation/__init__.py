"""The paper's Section III: how near to people the primitive moves, and how to bring it nearer."""

LEARN = ('single', 'mean', 'representative')
"""What is learnt from: each trial, the mean of all, the trial nearest to the mean."""

METHODS = ('decoupled', 'classical', 'minimum_jerk', 'human')
"""What moves in the place of P2."""
