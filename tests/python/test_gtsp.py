"""Tours."""

import itertools

import numpy as np
import pytest

import nullsweep
from nullsweep import gtsp


def best(costs, clusters):
    """By trying all."""
    def tours():
        for order in itertools.permutations(range(1, len(clusters))):
            for nodes in itertools.product(*(clusters[c] for c in (0, *order))):
                yield sum(costs[a, b] for a, b in zip(nodes, nodes[1:] + nodes[:1]))
    return min(tours())


def test_a_small_tour_is_the_best_one():
    random = np.random.default_rng(3)
    costs = random.uniform(1, 9, (10, 10))
    # Nodes in any order.
    nodes = list(map(int, random.permutation(10)))
    clusters = [nodes[0:2], nodes[2:5], nodes[5:6], nodes[6:8], nodes[8:10]]
    found = gtsp.solve(costs, clusters, trials=200, bound=5.0)
    assert found.cost == pytest.approx(best(costs, clusters))
    assert sorted(found.clusters) == [0, 1, 2, 3, 4]
    assert all(node in clusters[c] for c, node in zip(found.clusters, found.nodes))
    way = zip(found.nodes, found.nodes[1:] + found.nodes[:1])
    assert sum(costs[a, b] for a, b in way) == pytest.approx(found.cost)
    assert found.bound <= found.cost + 1e-6


def test_the_seed_decides():
    places = np.random.default_rng(5).uniform(size=(90, 2))
    costs = np.linalg.norm(places[:, None] - places[None], axis=2)
    clusters = np.arange(90).reshape(30, 3).tolist()
    solve = lambda **how: gtsp.solve(costs, clusters, trials=300, **how)
    assert solve(seed=2).nodes == solve(seed=2, threads=1).nodes
    bounded = solve(bound=2.0)
    assert bounded.bound is not None and 0.8 * bounded.cost < bounded.bound <= bounded.cost + 1e-9


def test_a_file_is_read(tmp_path):
    file = tmp_path / "4.gtsp"
    file.write_text("NAME: 4\nTYPE: GTSP\nDIMENSION: 4\nGTSP_SETS: 2\nEDGE_WEIGHT_TYPE: EUC_2D\n"
                    "NODE_COORD_SECTION\n1 0 0\n2 30 0\n3 10 0\n4 50 0\nGTSP_SET_SECTION\n"
                    "1 1 2 -1\n2 3 4 -1\nEOF\n")
    costs, clusters = gtsp.read(file)
    assert clusters == [[0, 1], [2, 3]] and costs[0, 2] == 10 and costs[1, 3] == 20
    found = gtsp.solve(costs, clusters)
    assert found.cost == 20 and found.nodes in ([0, 2], [2, 0]) and found.proven


def test_what_is_no_instance_is_refused():
    costs = np.ones((3, 3))
    with pytest.raises(nullsweep.UsageError, match="node 2 is in no cluster"):
        gtsp.solve(costs, [[0], [1]])
    with pytest.raises(nullsweep.UsageError, match="twice"):
        gtsp.solve(costs, [[0, 1], [1, 2]])
    with pytest.raises(nullsweep.UsageError, match="no node 3"):
        gtsp.solve(costs, [[0, 1], [2, 3]])
    with pytest.raises(TypeError, match="shape"):
        gtsp.solve(costs[:2], [[0], [1], [2]])
    with pytest.raises(nullsweep.Error, match="neither finite"):
        gtsp.solve(np.full((3, 3), np.nan), [[0], [1], [2]])
