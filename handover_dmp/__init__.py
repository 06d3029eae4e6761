"""Human to robot handover by a decoupled Dynamic Movement Primitive (Prada et al., IROS 2013)."""

__version__ = '0.1.0'
