"""Many takes in one go: a folder of results for each, a manifest with checksums, a page of all.

A take is finished when its record stands in its folder, which is written last and holds the checksums of all its files;
after a run was killed, the next one takes no other take as finished.
"""
