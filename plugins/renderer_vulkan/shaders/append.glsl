// SPDX-License-Identifier: Apache-2.0
// Places in a queue for those of a subgroup that want one, by one atomic operation. To be called
// by all.
#define APPEND(COUNTER, WANTS, PLACE)                                                   \
  {                                                                                     \
    const uvec4 ballot = subgroupBallot(WANTS);                                         \
    uint first = 0u;                                                                    \
    if (subgroupElect()) first = atomicAdd(COUNTER, subgroupBallotBitCount(ballot));    \
    PLACE = subgroupBroadcastFirst(first) + subgroupBallotExclusiveBitCount(ballot);    \
  }
