// The reverse process on a density over SE(3) whose denoiser is known: two modes, each a Gaussian of poses.
#include <cmath>

#include <gtest/gtest.h>

#include "diffusion/sampler.h"
#include "diffusion/schedule.h"
#include "diffusion/se3_noise.h"
#include "stability/shapes.h"

namespace dofusion {
namespace {

constexpr double kEdge = 0.05;    // metres; of all cubes, so that it is the normalised length
constexpr double kSpread = 0.06;  // of each mode, normalised and radians
constexpr double kShares[] = {0.7, 0.3};

// In normalised lengths, relative to the context.
Pose mode(int k) {
  return k == 0 ? make_pose(so3_exp({0.2, 0.1, 0.0}), {0.0, 0.3, 1.0})
                : make_pose(so3_exp({-0.1, 0.2, 0.4}), {1.2, -0.3, 0.8});
}

// The mean of the clean pose given the noisy one, as the default preset states it. Where the query is it reads off the
// cloud: the context's eight corners.
class ToyNetwork : public Network {
 public:
  const std::vector<TensorInfo>& tensors() const override { return tensors_; }
  std::vector<float> initial_parameters(std::uint64_t) const override { return {}; }
  void set_parameters(const std::vector<float>&) override {}
  std::vector<float> gradient(const NetworkInput&, const std::vector<float>&, std::vector<float>&) override { return {}; }
  bool scenes_are_independent() const override { return true; }

  std::vector<float> predict(const NetworkInput& input) const override {
    std::vector<float> output;
    for (int b = 0; b < input.batch; ++b) {
      const float* cloud = input.cloud.data() + static_cast<std::size_t>(b) * input.points * kCloudChannels;
      const float* pose = input.pose.data() + static_cast<std::size_t>(b) * 10;
      Pose noisy = Pose::Identity();
      for (int i = 0; i < 9; ++i) noisy.linear()(i / 3, i % 3) = pose[i];
      noisy.translation() = query_position(cloud, input.points, pose[9]);
      const Vector6 residual = denoise(noisy, input.sigma[static_cast<std::size_t>(b)]);
      for (int i = 0; i < 6; ++i) output.push_back(static_cast<float>(residual[i]));
    }
    return output;
  }

 private:
  static Eigen::Vector3d query_position(const float* cloud, int points, float height) {
    Eigen::Vector2d context = Eigen::Vector2d::Zero();
    for (int p = 0; p < points; ++p, cloud += kCloudChannels)
      if (cloud[4] == 0.0f) context += Eigen::Vector2d(cloud[0], cloud[1]) / 8.0;
    return {-context.x(), -context.y(), height};
  }

  static Vector6 denoise(const Pose& noisy, double sigma) {
    const double variance = kSpread * kSpread + sigma * sigma;
    Vector6 mean = Vector6::Zero();
    double sum = 0.0;
    for (int k = 0; k < 2; ++k) {
      const Vector6 way = world_residual(noisy, mode(k), 1e-9) * 1e-9;  // its rotation scale is the noise's there
      const double weight = kShares[k] * std::exp(-0.5 * way.squaredNorm() / variance);
      mean += weight * sigma * sigma / variance * way;
      sum += weight;
    }
    mean /= sum;
    Vector6 residual;
    residual << mean.head<3>() / sigma, mean.tail<3>() / rotation_scale(sigma);
    return residual;
  }

  std::vector<TensorInfo> tensors_;
};

struct ModeSamples {
  double share = 0.0;
  Vector6 mean = Vector6::Zero();  // from the mode
  double spread = 0.0;             // standard deviation of a coordinate
  int count = 0;
};

ModeSamples samples_of(int k, const std::vector<Pose>& poses) {
  ModeSamples result;
  double squares = 0.0;
  for (const Pose& pose : poses) {
    const Pose p = make_pose(pose.linear(), pose.translation() / kEdge);
    const auto from = [&](int other) { return Vector6(world_residual(mode(other), p, 1e-9) * 1e-9); };
    if (from(k).norm() > from(1 - k).norm()) continue;
    ++result.count;
    result.mean += from(k);
    squares += from(k).squaredNorm();
  }
  result.share = result.count / static_cast<double>(poses.size());
  result.mean /= result.count;
  result.spread = std::sqrt(squares / result.count / 6.0 - result.mean.squaredNorm() / 6.0);
  return result;
}

std::vector<Pose> sample(double freshness, int steps) {
  ModelConfig config;
  config.points = 16;  // the corners of the query and of the context
  config.neighbours = 1;
  config.sharp_share = 1.0;
  const PlacementModel model(config, std::make_unique<ToyNetwork>());
  const ObjectPtr cube = make_box("cube", Eigen::Vector3d::Constant(kEdge));
  std::vector<PlacementProblem> problems(4000);
  for (std::size_t i = 0; i < problems.size(); ++i) {
    problems[i].context = {{cube}, {make_pose(Eigen::Matrix3d::Identity(), {0, 0, kEdge / 2})}};
    problems[i].query = cube;
    problems[i].seed = i;
  }
  SamplerOptions options;
  options.steps = steps;
  options.freshness = freshness;
  options.threads = 2;
  return model.sample(problems, options);
}

constexpr int kSteps = 200;

double ratio() {
  const std::vector<double> sigmas = sampling_schedule({}, kSteps, ModelConfig().sigma_max);
  return sigmas[1] / sigmas[0];
}

TEST(SamplerDensity, AncestralSamplingRecoversModesTheirSharesAndTheirSpread) {
  const std::vector<Pose> poses = sample(std::sqrt(1.0 - ratio() * ratio()), kSteps);
  for (int k = 0; k < 2; ++k) {
    const ModeSamples seen = samples_of(k, poses);
    EXPECT_NEAR(seen.share, kShares[k], 0.04) << k;
    EXPECT_LT(seen.mean.cwiseAbs().maxCoeff(), 5.0 * kSpread / std::sqrt(seen.count)) << k;
    EXPECT_NEAR(seen.spread, kSpread, 0.05 * kSpread) << k;
  }
}

// x0(x) = s^2 / (s^2 + sigma^2) x + ..., then all noise anew: the recursion of a mode's variance.
TEST(SamplerDensity, TheEquationsSamplerKeepsToTheMiddleOfEachMode) {
  double variance = 1.0;
  const double s2 = kSpread * kSpread;
  for (const double sigma : sampling_schedule({}, kSteps, ModelConfig().sigma_max)) {
    const double kept = s2 / (s2 + sigma * sigma), next = sigma * ratio();
    variance = kept * kept * variance + (sigma > 1.01 * ModelConfig().sigma_min ? next * next : 0.0);
  }
  const std::vector<Pose> poses = sample(1.0, kSteps);
  for (int k = 0; k < 2; ++k) {
    const ModeSamples seen = samples_of(k, poses);
    EXPECT_GT(seen.share, 0.1) << k;
    EXPECT_LT(seen.mean.cwiseAbs().maxCoeff(), 5.0 * kSpread / std::sqrt(seen.count)) << k;
    EXPECT_NEAR(seen.spread, std::sqrt(variance), 0.05 * std::sqrt(variance)) << k;
    EXPECT_LT(seen.spread, 0.9 * kSpread) << k;
  }
}

}  // namespace
}  // namespace dofusion
