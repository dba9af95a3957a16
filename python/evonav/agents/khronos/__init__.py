"""Khronos' votes of rays before and after each object, on Frontier-Update."""
