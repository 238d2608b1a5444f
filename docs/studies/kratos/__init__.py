"""Records of structures that Kratos computes, for tests of the twin."""
