// Stable scenes made in code.
#pragma once

#include <cstdint>

#include "stability/dataset.h"

namespace dofusion {

// `count` scenes of one box of 40 x 60 x 100 mm lying on its largest face at a random place and yaw.
SceneDataset boxes_on_table(int count, std::uint64_t seed);

// Pairs of cubes (50 mm), the second exactly on top of the first.
SceneDataset stacked_cubes(int count, std::uint64_t seed);

}  // namespace dofusion
