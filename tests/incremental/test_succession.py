"""Ids of clusters: stable where objects are, new where something is new."""

import numpy as np

from mcpseg_cli.incremental.succession import find_successors


def succeed(old, cluster, *, size=None, objects=None, next_id=100):
    count = len(old)
    return find_successors(
        np.array(old, np.int32),
        np.ones(count, np.int64) if size is None else np.array(size, np.int64),
        np.array(cluster, np.int32),
        np.ones(count, bool) if objects is None else np.array(objects),
        next_id,
    )


def test_an_object_keeps_its_id_and_takes_in_new_voxels():
    found = succeed([7, 7, 0], [0, 0, 0])
    assert found.owner.tolist() == [7, 7, 7]
    assert (len(found.merges), len(found.splits), found.num_new) == (0, 0, 0)


def test_what_is_new_gets_new_ids_in_order_of_its_first_voxels():
    found = succeed([0, 0, 0, 0], [0, 1, 1, 3])
    assert found.owner.tolist() == [100, 101, 101, 102]
    assert found.num_new == 3
    assert len(found.splits) == 0


def test_of_two_that_merge_the_larger_one_keeps_its_id():
    found = succeed([3, 8, 8], [0, 0, 0])
    assert found.owner.tolist() == [8, 8, 8]
    assert found.merges.tolist() == [[3, 8]]


def test_of_two_of_one_size_that_merge_the_older_one_keeps_its_id():
    assert succeed([8, 3], [0, 0]).merges.tolist() == [[8, 3]]


def test_the_larger_part_of_a_split_keeps_the_id_and_the_other_gets_a_new_one():
    found = succeed([5, 5, 5], [0, 1, 1])
    assert found.owner.tolist() == [100, 5, 5]
    assert found.splits.tolist() == [[5, 100]]


def test_a_node_counts_for_all_its_voxels():
    found = succeed([5, 5, 5], [0, 1, 1], size=[40, 1, 1])
    assert found.owner.tolist() == [5, 100, 100]


def test_an_object_whose_larger_part_another_takes_over_is_merged_and_its_rest_is_new():
    # most of 4 goes to 9, which is larger; a voxel of 4 is left over
    found = succeed([4, 4, 9, 9, 9, 4], [0, 0, 0, 0, 0, 5])
    assert found.owner.tolist() == [9, 9, 9, 9, 9, 100]
    assert found.merges.tolist() == [[4, 9]]
    assert found.splits.tolist() == [[4, 100]]


def test_what_is_no_object_has_no_id_and_ends_one_it_had():
    found = succeed([6, 0], [0, 1], objects=[False, False])
    assert found.owner.tolist() == [0, 0]
    assert (len(found.merges), found.num_new) == (0, 0)


def test_merges_are_in_order_of_the_ids_that_are_gone():
    found = succeed([9, 4, 2, 2, 2], [0, 0, 0, 0, 0])
    assert found.merges.tolist() == [[4, 2], [9, 2]]
