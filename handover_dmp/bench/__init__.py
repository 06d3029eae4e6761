"""The benchmark: every figure beside its target, its floor and its peers, from one run."""
