// The /shapes group of a dataset (stability/dataset.h).
#pragma once

#include <vector>

#include "stability/hdf5_file.h"
#include "stability/scene.h"

namespace dofusion {

// Throws InputError naming the file and the row that cannot be.
std::vector<ObjectPtr> read_shapes(const Hdf5Reader& reader);

void write_shapes(const std::vector<ObjectPtr>& shapes, Hdf5Writer& writer);

// `start` must run from 0 to `total` without falling and have count+1 rows; else InputError.
void check_starts(const Hdf5Reader& reader, const std::string& name, const std::vector<std::int64_t>& start,
                  std::size_t count, std::size_t total);

}  // namespace dofusion
