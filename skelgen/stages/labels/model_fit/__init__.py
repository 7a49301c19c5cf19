"""Identities from a skeleton: it is fitted to the markers found so far, and says where each marker must be."""
