#include "diffusion/trainer.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <stdexcept>
#include <thread>

#include <nlohmann/json.hpp>

#include "diffusion/checkpoint.h"
#include "diffusion/weights.h"
#include "stability/files.h"

namespace dofusion {
namespace {

using Clock = std::chrono::steady_clock;

double since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

// Sums of losses by noise since the last report.
struct LossMeter {
  double sum[3] = {}, norm = 0.0;
  std::int64_t count[3] = {}, steps = 0;

  void add(const ModelConfig& config, double sigma, double loss) {
    const double u = std::log(sigma / config.sigma_min) / std::log(config.sigma_max / config.sigma_min);
    const int third = std::clamp(static_cast<int>(3 * u), 0, 2);
    sum[third] += loss;
    ++count[third];
  }
  std::int64_t samples() const { return count[0] + count[1] + count[2]; }
};

// One step's gradient: micro-batches are handed to whichever thread is free.
class GradientWorkers {
 public:
  GradientWorkers(const TrainingSet& data, Network& network, const TrainOptions& options)
      : data_(data),
        network_(network),
        options_(options),
        threads_(network.scenes_are_independent() ? options.threads : 1) {
    gradients_.resize(threads_, std::vector<float>(network.parameter_count()));
  }

  // Mean gradient of step `step`; losses and noise scales of its scenes, (batch) each.
  const std::vector<float>& run(std::int64_t step, std::vector<float>& losses, std::vector<float>& sigmas) {
    const int micro = network_.scenes_are_independent() ? options_.micro_batch : options_.batch;
    losses.assign(options_.batch, 0.0f);
    sigmas.assign(options_.batch, 0.0f);
    std::atomic<int> next{0};
    std::exception_ptr failure;
    std::atomic<bool> failed{false};
    const auto work = [&](int thread) {
      std::vector<float>& gradient = gradients_[thread];
      std::fill(gradient.begin(), gradient.end(), 0.0f);
      try {
        for (int start = next.fetch_add(micro); start < options_.batch && !failed; start = next.fetch_add(micro)) {
          const int end = std::min(start + micro, options_.batch);
          NetworkInput input;
          std::vector<float> target;
          for (int i = start; i < end; ++i)
            data_.append(options_.seed, static_cast<std::uint64_t>(step * options_.batch + i), input, target);
          const std::vector<float> part = network_.gradient(input, target, gradient);
          std::copy(part.begin(), part.end(), losses.begin() + start);
          std::copy(input.sigma.begin(), input.sigma.end(), sigmas.begin() + start);
        }
      } catch (...) {
        if (!failed.exchange(true)) failure = std::current_exception();
      }
    };
    in_parallel(work);
    if (failure) std::rethrow_exception(failure);
    const std::size_t size = gradients_[0].size();
    const float factor = 1.0f / static_cast<float>(options_.batch);
    in_parallel([&](int thread) {
      const std::size_t begin = size * thread / threads_, end = size * (thread + 1) / threads_;
      for (int t = 1; t < threads_; ++t)
        for (std::size_t i = begin; i < end; ++i) gradients_[0][i] += gradients_[t][i];
      for (std::size_t i = begin; i < end; ++i) gradients_[0][i] *= factor;
    });
    return gradients_[0];
  }

 private:
  template <typename Work>
  void in_parallel(const Work& work) {
    std::vector<std::thread> helpers;
    for (int t = 1; t < threads_; ++t) helpers.emplace_back(work, t);
    work(0);
    for (std::thread& helper : helpers) helper.join();
  }

  const TrainingSet& data_;
  Network& network_;
  const TrainOptions& options_;
  int threads_;
  std::vector<std::vector<float>> gradients_;
};

void append_log(const std::string& path, const TrainReport& r) {
  const bool fresh = !std::filesystem::exists(path);
  std::FILE* file = std::fopen(path.c_str(), "a");
  if (!file) throw InputError(path + ": cannot be written");
  if (fresh)
    std::fprintf(
        file,
        "step,samples,seconds,samples_per_second,learning_rate,gradient_norm,loss,loss_low,loss_middle,loss_high\n");
  std::fprintf(file, "%lld,%lld,%.1f,%.1f,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g\n", static_cast<long long>(r.step),
               static_cast<long long>(r.samples), r.seconds, r.samples_per_second, r.learning_rate, r.gradient_norm,
               r.loss, r.loss_by_noise[0], r.loss_by_noise[1], r.loss_by_noise[2]);
  std::fclose(file);
}

std::string training_record(const std::string& record, const TrainOptions& options, const TrainReport& last,
                            std::size_t scenes) {
  nlohmann::json j = record.empty() ? nlohmann::json::object() : nlohmann::json::parse(record);
  j["steps"] = last.step;
  j["samples"] = last.samples;
  j["seconds"] = last.seconds;
  j["progress"] = last.progress;
  j["scenes"] = scenes;
  j["seed"] = options.seed;
  j["batch"] = options.batch;
  j["learning_rate"] = options.optimizer.learning_rate;
  j["weight_decay"] = options.optimizer.weight_decay;
  j["average"] = options.optimizer.average;
  if (last.samples > 0 && std::isfinite(last.loss)) j["loss"] = last.loss;
  return j.dump();
}

}  // namespace

TrainResult train(const TrainingSet& data, const ModelConfig& config, const TrainOptions& options,
                  const std::string& record, const TrainCallback& report, const TrainCallback& keep_going) {
  if (options.minutes <= 0 && options.steps <= 0) throw InputError("training needs --minutes or --steps");
  if (options.batch < 1 || options.micro_batch < 1 || options.threads < 1)
    throw InputError("batch, micro batch and threads must be at least 1");
  const std::unique_ptr<Network> network = make_network(config);
  const std::string checkpoint_path = options.out + ".checkpoint", log_path = options.out + ".csv";

  Checkpoint run;
  if (options.resume) {
    run = read_checkpoint(network->tensors(), checkpoint_path);
    if (to_json(run.config) != to_json(config) || run.seed != options.seed || run.batch != options.batch)
      throw InputError(checkpoint_path + ": left by a run with another configuration, seed or batch size");
  } else {
    run.config = config;
    run.seed = options.seed;
    run.batch = options.batch;
    run.state = initial_state(network->initial_parameters(options.seed));
    std::error_code ignored;
    std::filesystem::remove(log_path, ignored);
  }
  OptimizerState& state = run.state;

  TrainResult result;
  const double seconds_before = run.seconds;
  const Clock::time_point start = Clock::now();
  Clock::time_point reported = start, saved = start;
  LossMeter meter;
  GradientWorkers workers(data, *network, options);
  std::vector<float> losses, sigmas;

  const auto progress = [&] {
    double p = 0.0;
    if (options.minutes > 0) p = std::max(p, run.seconds / (60.0 * options.minutes));
    if (options.steps > 0) p = std::max(p, static_cast<double>(state.step) / static_cast<double>(options.steps));
    return std::min(p, 1.0);
  };
  const auto make_report = [&] {
    TrainReport r;
    r.step = state.step;
    r.samples = state.step * options.batch;
    r.seconds = run.seconds;
    r.progress = progress();
    r.seconds_left = r.progress > 0 ? run.seconds * (1.0 - r.progress) / r.progress : 0.0;
    r.samples_per_second = static_cast<double>(meter.samples()) / std::max(1e-9, since(reported));
    r.learning_rate = options.optimizer.learning_rate * learning_rate_factor(state.step, options.warm_up, r.progress);
    r.gradient_norm = meter.norm / static_cast<double>(std::max<std::int64_t>(1, meter.steps));
    double sum = 0.0;
    for (int i = 0; i < 3; ++i) {
      r.loss_by_noise[i] = meter.count[i] ? meter.sum[i] / static_cast<double>(meter.count[i])
                                          : std::numeric_limits<double>::quiet_NaN();
      sum += meter.sum[i];
    }
    r.loss = meter.samples() ? sum / static_cast<double>(meter.samples()) : std::numeric_limits<double>::quiet_NaN();
    return r;
  };
  const auto save = [&] {
    write_checkpoint(run, network->tensors(), checkpoint_path);
    write_model({config, training_record(record, options, result.last, data.scenes()), state.average}, options.out);
    saved = Clock::now();
  };

  result.last = make_report();
  save();  // an output that cannot be written fails now
  bool stopped = false;
  while (progress() < 1.0 && !stopped) {
    network->set_parameters(state.parameters);
    const std::vector<float>& gradient = workers.run(state.step, losses, sigmas);
    double loss = 0.0;
    for (int i = 0; i < options.batch; ++i) {
      loss += losses[i] / static_cast<double>(options.batch);
      meter.add(config, sigmas[i], losses[i]);
    }
    if (!std::isfinite(loss))
      throw std::runtime_error("the loss is not finite at step " + std::to_string(state.step) +
                               "; the last good state is in " + checkpoint_path);
    const double rate = learning_rate_factor(state.step, options.warm_up, progress());
    meter.norm += optimizer_step(options.optimizer, network->tensors(), rate, gradient, state, options.threads);
    ++meter.steps;
    network->get_state(state.parameters);
    network->get_state(state.average);
    result.losses.push_back(static_cast<float>(loss));
    run.seconds = seconds_before + since(start);

    if (since(reported) >= options.report_seconds || progress() >= 1.0) {
      result.last = make_report();
      append_log(log_path, result.last);
      if (report && !report(result.last)) stopped = true;
      meter = {};
      reported = Clock::now();
    }
    if (keep_going && !keep_going(result.last)) stopped = true;
    if (since(saved) >= options.checkpoint_seconds) save();
  }
  if (meter.steps > 0) {
    result.last = make_report();
    append_log(log_path, result.last);
  }
  save();
  result.finished = progress() >= 1.0;
  return result;
}

}  // namespace dofusion
