"""Gymnasium environments over the embedded simulator; importing this registers `evonav/LifelongNav-v0`.

The environments themselves are imported when they are first used, so that naming the id costs nothing.
"""

import lazy_loader

from evonav.gym.registration import register

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

register()
