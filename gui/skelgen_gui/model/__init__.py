"""What the window shows, in plain numbers and texts, without Qt: scene, camera, graph, matrix, lanes, curves."""
