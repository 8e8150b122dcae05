#include "diffusion/sampler.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <map>
#include <stdexcept>
#include <thread>
#include <utility>

#include "diffusion/augmented_cloud.h"
#include "diffusion/network.h"
#include "diffusion/schedule.h"
#include "diffusion/se3_noise.h"
#include "diffusion/training_data.h"
#include "diffusion/weights.h"

namespace dofusion {
namespace {

constexpr int kTogether = 8;  // problems that share one call of the network

// A problem on its way from noise to a pose.
struct Walk {
  std::vector<CloudShapePtr> shapes;  // the query first
  std::vector<Pose> poses;            // T_world_object
  Eigen::Vector2d centre;
  std::vector<PoseCostPtr> guides;
  double length = 1.0;
  Rng rng;
};

// Clouds of the same object need its triangles only once.
class ShapeCache {
 public:
  CloudShapePtr get(const ObjectPtr& object) {
    CloudShapePtr& shape = shapes_[object.get()];
    if (!shape) shape = std::make_shared<CloudShape>(*object);
    return shape;
  }

 private:
  std::map<const Object*, CloudShapePtr> shapes_;
};

void check_problem(const PlacementProblem& p) {
  if (!p.query) throw std::invalid_argument("a placement problem needs a query object");
  if (p.context.objects.size() != p.context.T_world_object.size())
    throw std::invalid_argument("a placement problem needs one pose per context object");
  for (const Pose& pose : p.context.T_world_object)
    if (!pose.matrix().allFinite()) throw std::invalid_argument("a context object's pose is not finite");
  if (!p.centre.allFinite() || (p.start && !p.start->matrix().allFinite()))
    throw std::invalid_argument("a placement problem's centre or start is not finite");
}

Walk begin(const PlacementProblem& problem, double sigma, ShapeCache& cache) {
  Walk walk;
  walk.rng = make_rng(problem.seed, 0x706c616365u);
  walk.centre = problem.centre;
  walk.guides = problem.guides;
  walk.shapes.push_back(cache.get(problem.query));
  std::vector<double> volumes{problem.query->volume};
  for (const ObjectPtr& object : problem.context.objects) {
    walk.shapes.push_back(cache.get(object));
    volumes.push_back(object->volume);
  }
  walk.length = normalised_length(volumes);
  walk.poses = {Pose::Identity()};
  walk.poses.insert(walk.poses.end(), problem.context.T_world_object.begin(), problem.context.T_world_object.end());
  if (problem.start) {
    walk.poses[0] = add_world_noise(*problem.start, noise6(walk.rng, sigma), walk.length);
  } else {
    // Noise swamps the orientation, so that is uniform; the height's mean is about that of an object on the table.
    const Eigen::Vector3d mean(problem.centre.x(), problem.centre.y(), walk.length);
    const Eigen::Matrix3d R = random_rotation(walk.rng);
    walk.poses[0] = make_pose(R, mean + walk.length * normal3(walk.rng, sigma));
  }
  return walk;
}

}  // namespace

Eigen::Vector2d default_centre(const Scene& context) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Pose& pose : context.T_world_object) sum += pose.translation().head<2>();
  return context.T_world_object.empty() ? sum
                                        : Eigen::Vector2d(sum / static_cast<double>(context.T_world_object.size()));
}

struct PlacementModel::Impl {
  ModelConfig config;
  std::unique_ptr<Network> network;

  // Equation (2): x0 = D(x_t), then noise of the next scale around it.
  void step(std::vector<Walk>& walks, double sigma, double next, const SamplerOptions& options) const {
    NetworkInput input;
    for (Walk& walk : walks)
      append_input(config, walk.shapes, walk.poses, 0, walk.length, sigma, walk.centre,
                   options.points > 0 ? options.points : config.points, walk.rng, input);
    const std::vector<float> output = network->predict(input);
    for (std::size_t i = 0; i < walks.size(); ++i) {
      const Vector6 predicted = Eigen::Map<const Eigen::Matrix<float, 6, 1>>(output.data() + 6 * i).cast<double>();
      Walk& walk = walks[i];
      const bool paper = config.preset == Preset::kPaper;
      Pose clean = paper ? remove_body_noise(walk.poses[0], sigma * predicted, walk.length)
                         : apply_world_residual(walk.poses[0], predicted, sigma, walk.length);
      if (!walk.guides.empty()) clean = guided(walk.guides, clean, sigma * walk.length, rotation_scale(sigma));
      if (next <= 0) {
        walk.poses[0] = clean;
      } else if (paper) {
        walk.poses[0] = add_body_noise(clean, noise6(walk.rng, next), walk.length);
      } else {
        // A part of the old noise may be kept instead of drawing all of it afresh.
        const double keep = std::sqrt(1.0 - options.freshness * options.freshness);
        Vector6 old = -predicted * next * keep;
        old.tail<3>() *= rotation_scale(sigma) / sigma;  // residuals of rotation are in another unit than noise
        walk.poses[0] = add_world_noise(clean, old + noise6(walk.rng, next * options.freshness), walk.length);
      }
    }
  }
};

PlacementModel::PlacementModel(const ModelConfig& config, const std::vector<float>& parameters)
    : PlacementModel(config, make_network(config)) {
  impl_->network->set_parameters(parameters);
}
PlacementModel::PlacementModel(const ModelConfig& config, std::unique_ptr<Network> network)
    : impl_(std::make_unique<Impl>()) {
  impl_->config = config;
  impl_->network = std::move(network);
}
PlacementModel::~PlacementModel() = default;
PlacementModel::PlacementModel(PlacementModel&&) noexcept = default;
PlacementModel& PlacementModel::operator=(PlacementModel&&) noexcept = default;

PlacementModel PlacementModel::load(const std::string& path) {
  const ModelFile file = read_model(path);
  return PlacementModel(file.config, file.parameters);
}

const ModelConfig& PlacementModel::config() const { return impl_->config; }

std::vector<Pose> PlacementModel::sample(const std::vector<PlacementProblem>& problems,
                                         const SamplerOptions& options) const {
  if (options.threads < 1 || !(options.freshness >= 0 && options.freshness <= 1))
    throw std::invalid_argument("sampling needs at least one thread and a freshness between 0 and 1");
  if (options.points != 0 && (options.points < 32 || options.points > 4096 || options.points % 2 != 0))
    throw std::invalid_argument("points must be even and between 32 and 4096, not " + std::to_string(options.points));
  for (const PlacementProblem& problem : problems) check_problem(problem);
  const double first = options.start_sigma > 0 ? options.start_sigma : impl_->config.sigma_max;
  const std::vector<double> sigmas = sampling_schedule(impl_->config, options.steps, first);

  std::vector<Pose> result(problems.size());
  const int groups = (static_cast<int>(problems.size()) + kTogether - 1) / kTogether;
  std::atomic<int> next_group{0};
  std::atomic<bool> failed{false};
  std::exception_ptr failure;
  const auto work = [&] {
    try {
      ShapeCache cache;
      for (int g = next_group++; g < groups && !failed; g = next_group++) {
        const std::size_t begin_index = static_cast<std::size_t>(g) * kTogether;
        const std::size_t end_index = std::min(begin_index + kTogether, problems.size());
        // A network call takes one number of points, whatever the number of objects.
        std::vector<Walk> walks;
        for (std::size_t i = begin_index; i < end_index; ++i) walks.push_back(begin(problems[i], sigmas[0], cache));
        for (std::size_t s = 0; s < sigmas.size(); ++s)
          impl_->step(walks, sigmas[s], s + 1 < sigmas.size() ? sigmas[s + 1] : 0.0, options);
        for (std::size_t i = begin_index; i < end_index; ++i) result[i] = walks[i - begin_index].poses[0];
      }
    } catch (...) {
      if (!failed.exchange(true)) failure = std::current_exception();
    }
  };
  std::vector<std::thread> helpers;
  for (int t = 1; t < std::min(options.threads, groups); ++t) helpers.emplace_back(work);
  work();
  for (std::thread& helper : helpers) helper.join();
  if (failure) std::rethrow_exception(failure);
  return result;
}

}  // namespace dofusion
