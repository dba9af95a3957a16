"""Gymnasium environments over the embedded simulator; importing this package registers `evonav/LifelongNav-v0`.

The environments are imported on first use, so the id alone costs nothing.
"""

import lazy_loader

from evonav.gym.registration import register

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

register()
