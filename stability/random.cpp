#include "stability/random.h"

#include <Eigen/Geometry>

namespace dofusion {

Rng make_rng(std::uint64_t seed, std::uint64_t stream) {
  std::seed_seq sequence{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32),
                         static_cast<std::uint32_t>(stream), static_cast<std::uint32_t>(stream >> 32)};
  return Rng(sequence);
}

double uniform(Rng& rng, double low, double high) { return std::uniform_real_distribution<double>(low, high)(rng); }

int uniform_int(Rng& rng, int low, int high) { return std::uniform_int_distribution<int>(low, high)(rng); }

double normal(Rng& rng, double sigma) { return std::normal_distribution<double>(0.0, 1.0)(rng) * sigma; }

Eigen::Vector3d normal3(Rng& rng, double sigma) {
  const double x = normal(rng, sigma), y = normal(rng, sigma), z = normal(rng, sigma);
  return {x, y, z};
}

Eigen::Matrix3d random_rotation(Rng& rng) {
  // A normalised Gaussian 4-vector is uniform on the unit quaternions.
  const double w = normal(rng), x = normal(rng), y = normal(rng), z = normal(rng);
  return Eigen::Quaterniond(w, x, y, z).normalized().toRotationMatrix();
}

}  // namespace dofusion
