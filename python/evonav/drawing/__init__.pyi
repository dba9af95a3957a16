from .pictures import Picture, boxes_picture, cells_picture, house_picture

__all__ = ["Picture", "boxes_picture", "cells_picture", "house_picture"]
