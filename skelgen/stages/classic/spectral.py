r"""Spectral clustering of markers, and the number of clusters from the alignment of eigenvectors.

Clusters are those of Ng, Jordan and Weiss (2002), with one sigma or with local scaling (Zelnik-Manor and Perona 2004,
self-tuning clustering). With the right number k the rows of the k leading eigenvectors X, turned by a rotation R, lie
on the axes: each has one entry that is not zero. The rotation minimises

.. math::
    J = \sum_{i,c} \frac{Z_{ic}^2}{\max_c Z_{ic}^2}, \qquad Z = X R,

which is n for perfect alignment. R is a product of rotations in the planes of two axes; they are improved one after the
other, and k + 1 starts from the alignment of k. The largest k whose alignment is all but the best is the number.

Rows are clustered by scikit-learn's k-means or by local search: centres are swapped for points, with or without Lloyd's
steps after each swap. These heuristics are those of kmlocal, which the thesis uses (Kanungo et al. 2002, A local search
approximation algorithm for k-means clustering; Schönauer 2007, 4.3 and table 4.15).
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from skelgen.model.arrays import Floats, Ints

SIGMA_QUANTILES = np.linspace(0.02, 0.6, 12)
"""A scan tries the global sigma at these quantiles of all deviations: from within the limbs to between them."""

KMEANS_STARTS = 10

LEAST_DEGREE = 1e-12
"""A marker whose affinities sum to less is alike to none."""


@dataclass(frozen=True)
class SpectralMethod:
    """How deviations of distances become affinities, and affinities clusters.

    Attributes
    ----------
    measure : str
        ``deviation`` or ``variance`` of distances.
    local_scaling : bool
        Whether each marker is scaled by its neighbour rather than all by one sigma.
    neighbour : int
        Which neighbour sets the local scale.
    sigma_squared : float, mm^2
        Square of the one sigma; 0 scans for the best.
    kmeans : str
        ``k-means++`` or ``random`` starts of Lloyd's steps, or one of the heuristics of `local_kmeans`.
    """

    measure: str
    local_scaling: bool
    neighbour: int
    sigma_squared: float
    kmeans: str


def spectral_clusters(deviation: Floats, k: int, method: SpectralMethod, seed: int) -> Ints:
    """Cluster markers by the eigenvectors of their normalised affinity.

    Parameters
    ----------
    deviation : ndarray, shape (n_markers, n_markers), mm
        Complete standard deviations of distances.
    k : int
        Number of clusters.
    method : SpectralMethod
        Scaling, measure and k-means.
    seed : int
        Seed of k-means.

    Returns
    -------
    ndarray of intp, shape (n_markers,)
        Cluster of each marker.
    """
    if k == 1:
        return np.zeros(len(deviation), dtype=np.intp)
    trials = [_partition(_embedding(affinity, k), k, method, seed) for affinity in affinities(deviation, method)]
    return min(trials, key=lambda labels: _inner_deviation(deviation, labels))


def affinities(deviation: Floats, method: SpectralMethod) -> list[Floats]:
    """Return affinity matrices to try: one with local scaling or a given sigma, several for a scan.

    This is step 1 of Schönauer (2007, 3.4.2).

    Parameters
    ----------
    deviation : ndarray, shape (n_markers, n_markers), mm
        Complete standard deviations of distances.
    method : SpectralMethod
        Measure and scaling.
    """
    distance = deviation if method.measure == "deviation" else deviation**2
    off = ~np.eye(len(distance), dtype=bool)
    floor = np.finfo(np.float64).tiny ** 0.25
    if method.local_scaling:
        m = min(method.neighbour, len(distance) - 1)
        scale = np.maximum(np.sort(distance, axis=1)[:, m], floor)
        return [np.exp(-(distance**2) / (scale[:, np.newaxis] * scale)) * off]
    if method.sigma_squared > 0:
        scales = [method.sigma_squared]
    else:
        scales = [max(float(sigma), floor) ** 2 for sigma in np.quantile(distance[off], SIGMA_QUANTILES)]
    return [np.exp(-(distance**2) / (2 * scale)) * off for scale in scales]


def _embedding(affinity: Floats, k: int) -> Floats:
    """Normalised rows of the k leading eigenvectors, shape (n_markers, k): steps 2-4 of Schönauer (2007, 3.4.2)."""
    _, vectors = spectrum(affinity)
    leading = vectors[:, -k:]
    norms = np.linalg.norm(leading, axis=1, keepdims=True)
    return np.asarray(leading / np.maximum(norms, np.finfo(np.float64).tiny))


def spectrum(affinity: Floats) -> tuple[Floats, Floats]:
    """Return eigenvalues (rising) and eigenvectors of the normalised affinity D^-1/2 W D^-1/2.

    Parameters
    ----------
    affinity : ndarray, shape (n_markers, n_markers)
        W, symmetric and not negative; D has its row sums.

    Returns
    -------
    values : ndarray, shape (n_markers,)
        Eigenvalues.
    vectors : ndarray, shape (n_markers, n_markers)
        Eigenvectors as columns.
    """
    degree = affinity.sum(axis=1)
    root = np.where(degree > LEAST_DEGREE, 1 / np.sqrt(np.maximum(degree, np.finfo(np.float64).tiny)), 0.0)
    values, vectors = np.linalg.eigh(root[:, np.newaxis] * affinity * root)
    return values, vectors


def greedy_clusters(deviation: Floats, k: int) -> Ints:
    """Join the two clusters with the smallest deviation between them until k are left (Schönauer 2007, 5.3).

    Parameters
    ----------
    deviation : ndarray, shape (n_markers, n_markers), mm
        Complete standard deviations of distances.
    k : int
        Number of clusters.
    """
    from scipy.cluster.hierarchy import fcluster, linkage  # noqa: PLC0415 - heavy
    from scipy.spatial.distance import squareform  # noqa: PLC0415 - heavy

    tree = linkage(squareform(deviation, checks=False), method="single")
    return np.asarray(fcluster(tree, k, criterion="maxclust") - 1, dtype=np.intp)


def _partition(rows: Floats, k: int, method: SpectralMethod, seed: int) -> Ints:
    if method.kmeans in HEURISTICS:
        return local_kmeans(rows, k, method.kmeans, seed)
    from sklearn.cluster import KMeans  # noqa: PLC0415 - its import costs seconds

    kmeans = KMeans(n_clusters=k, init=method.kmeans, n_init=KMEANS_STARTS, random_state=seed)
    return np.asarray(kmeans.fit_predict(rows), dtype=np.intp)


def _inner_deviation(deviation: Floats, labels: Ints) -> float:
    """Mean deviation within clusters: the smaller, the better the clustering (Kirk et al. 2005)."""
    same = (labels[:, np.newaxis] == labels) & ~np.eye(len(labels), dtype=bool)
    return float(deviation[same].mean()) if same.any() else np.inf


AS_GOOD = 0.001
"""Alignments that differ by less are alike; the paper's value."""

SWEEPS = 3
"""Turns through all planes for each k: the start is near, more change nothing."""

ANGLES = np.linspace(-np.pi / 4, np.pi / 4, 17)
"""Rotations tried in a plane, rad: beyond an eighth of a turn the axes only change places."""

TINY = 1e-300


def aligned_count(vectors: Floats) -> int:
    """Return the number of clusters that aligns eigenvectors best.

    Parameters
    ----------
    vectors : ndarray, shape (n_markers, n_vectors)
        Eigenvectors of the normalised affinity, the leading one first.
    """
    n_markers, largest = len(vectors), max(1, min(vectors.shape[1], len(vectors) // 2))
    quality = [1.0 - _spread(vectors[:, :1]) / n_markers]
    turned = vectors[:, :1]
    for k in range(2, largest + 1):
        turned = _turned(np.column_stack([turned, vectors[:, k - 1]]))
        quality.append(1.0 - (_spread(turned) / n_markers - 1.0) / k)
    best = max(quality[1:], default=0.0)
    good = [k for k in range(2, largest + 1) if quality[k - 1] > best - AS_GOOD]
    return max(good, default=1)


def _turned(columns: Floats) -> Floats:
    """Turn columns in all planes so that each row has one large entry."""
    columns = columns.copy()
    for _ in range(SWEEPS):
        squares = columns**2
        for first, second in combinations(range(columns.shape[1]), 2):
            others = np.delete(squares, (first, second), axis=1)
            rest, largest = others.sum(axis=1), others.max(axis=1, initial=0.0)
            pair = columns[:, [first, second]]
            angle = _best_angle(pair, rest, largest)
            if angle != 0.0:
                sine, cosine = np.sin(angle), np.cos(angle)
                columns[:, [first, second]] = pair @ np.array([[cosine, -sine], [sine, cosine]])
                squares[:, [first, second]] = columns[:, [first, second]] ** 2
    return columns


def _best_angle(pair: Floats, rest: Floats, largest: Floats) -> float:
    """Angle that aligns two columns best, given the sum and the largest of the other squares in each row."""
    scale = (pair**2).sum(axis=1) + rest
    one = (pair[:, :1] * np.cos(ANGLES) + pair[:, 1:] * np.sin(ANGLES)) ** 2
    two = (pair**2).sum(axis=1, keepdims=True) - one
    peak = np.maximum(np.maximum(one, two), largest[:, np.newaxis])
    costs = (scale[:, np.newaxis] / np.maximum(peak, TINY)).sum(axis=0)
    best = int(np.argmin(costs))
    return float(ANGLES[best]) if costs[best] < costs[len(ANGLES) // 2] else 0.0


def _spread(columns: Floats) -> float:
    squares = columns**2
    return float((squares.sum(axis=1) / np.maximum(squares.max(axis=1), TINY)).sum())


HEURISTICS = ("swap", "hybrid", "local-hybrid")

N_SWAPS = 500
"""Swaps that are tried: some ten for each marker of a body."""

LLOYD_STEPS = 10
FIRST_TEMPERATURE = 0.1
"""Of the distortion: what a swap of the hybrid may make worse in the beginning."""


def local_kmeans(rows: Floats, k: int, heuristic: str, seed: int) -> Ints:
    """Cluster points by k centres, improved by swaps.

    Parameters
    ----------
    rows : ndarray, shape (n_points, n_dimensions)
        The points.
    k : int
        Number of clusters.
    heuristic : str
        ``swap`` keeps swaps that lower the distortion; ``local-hybrid`` moves all centres by Lloyd's steps after each
        swap; ``hybrid`` does that too, and accepts worse ones at first, less and less.
    seed : int
        Of the swaps.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Cluster of each point.
    """
    random = np.random.default_rng(seed)
    centres = rows[random.choice(len(rows), k, replace=False)]
    distortion = _distortion(rows, centres)
    best, least = centres, distortion
    for swap in range(N_SWAPS):
        tried = centres.copy()
        tried[random.integers(k)] = rows[random.integers(len(rows))]
        if heuristic != "swap":
            tried = _lloyd(rows, tried)
        new = _distortion(rows, tried)
        worse = new - distortion
        allowed = FIRST_TEMPERATURE * least * (1 - swap / N_SWAPS) if heuristic == "hybrid" else 0.0
        if worse <= 0 or (allowed > 0 and random.random() < np.exp(-worse / allowed)):
            centres, distortion = tried, new
        if distortion < least:
            best, least = centres, distortion
    return _nearest(rows, best)


def _lloyd(rows: Floats, centres: Floats) -> Floats:
    """Move each centre to the mean of its points, until none moves or the steps are done."""
    for _ in range(LLOYD_STEPS):
        member = _nearest(rows, centres)[:, np.newaxis] == np.arange(len(centres))
        count = member.sum(axis=0)[:, np.newaxis]
        moved = np.where(count > 0, member.T @ rows / np.maximum(count, 1), centres)
        if np.array_equal(moved, centres):
            break
        centres = moved
    return centres


def _nearest(rows: Floats, centres: Floats) -> Ints:
    return np.asarray(_squares(rows, centres).argmin(axis=1), dtype=np.intp)


def _distortion(rows: Floats, centres: Floats) -> float:
    return float(_squares(rows, centres).min(axis=1).sum())


def _squares(rows: Floats, centres: Floats) -> Floats:
    return np.asarray(((rows[:, np.newaxis] - centres) ** 2).sum(axis=2))
