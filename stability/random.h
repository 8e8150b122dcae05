// Explicit randomness: every draw in the toolkit comes from an Rng made from a seed.
#pragma once

#include <cstdint>
#include <random>

#include <Eigen/Core>

namespace dofusion {

using Rng = std::mt19937_64;

// An independent generator for item `stream` of a job with `seed`: item k gives the same draws whatever thread or
// process works on it.
Rng make_rng(std::uint64_t seed, std::uint64_t stream = 0);

double uniform(Rng& rng, double low = 0.0, double high = 1.0);
int uniform_int(Rng& rng, int low, int high);  // low and high included
double normal(Rng& rng, double sigma = 1.0);
Eigen::Vector3d normal3(Rng& rng, double sigma = 1.0);
Eigen::Matrix3d random_rotation(Rng& rng);  // uniform over SO(3)

}  // namespace dofusion
