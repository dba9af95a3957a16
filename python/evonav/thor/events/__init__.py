"""Events: metadata and images of the scene, encoded as AI2-THOR's client reads them."""
