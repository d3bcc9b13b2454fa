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
        f"sim=sapien needs SAPIEN: pip install 'sapien>=3.0.3' ({error})"
    ) from error

sapien.set_log_level(
    "critical"
)  # it warns of missing graphics; errors are raised anyway

__all__ = ["physx", "sapien"]
