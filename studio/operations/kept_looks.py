"""Caches of footage and runs that are being looked at: composed pictures, evaluated likelihoods."""

from studio.results.inspection.likelihoods import forget_evaluations, let_evaluations_rest
from studio.results.overlay_pictures import forget_composers, let_composers_rest


def forget_looks() -> None:
    """Close the footage and empty its caches, so that it can be moved or changed."""
    forget_composers()
    forget_evaluations()


def let_looks_rest() -> None:
    """Close whatever was not looked at for long."""
    let_composers_rest()
    let_evaluations_rest()
