"""Import SAPIEN without its warnings about graphics libraries: physics needs none."""

import warnings

from core.errors import UserError

try:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import sapien
        from sapien import physx
except ImportError as error:
    raise UserError(
        f"sim=sapien needs SAPIEN: pip install 'sapien>=3.0.3,<3.1' ({error})"
    ) from error

# It warns of missing graphics; errors are raised anyway.
sapien.set_log_level("critical")

__all__ = ["physx", "sapien"]
