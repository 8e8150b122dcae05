#include "diffusion/trainer.h"

#include <algorithm>
#include <array>
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

// Sums of losses by noise, of a step or since the last report.
struct LossMeter {
  std::array<double, 3> sum{}, count{};
  double norm = 0.0;
  std::int64_t steps = 0;

  void add(const ModelConfig& config, double sigma, double loss) {
    const double u = std::log(sigma / config.sigma_min) / std::log(config.sigma_max / config.sigma_min);
    const auto third = static_cast<std::size_t>(std::clamp(static_cast<int>(3 * u), 0, 2));
    sum[third] += loss;
    count[third] += 1.0;
  }
  void add(const LossMeter& step) {
    for (std::size_t i = 0; i < 3; ++i) {
      sum[i] += step.sum[i];
      count[i] += step.count[i];
    }
  }
  double samples() const { return count[0] + count[1] + count[2]; }
  double loss() const { return (sum[0] + sum[1] + sum[2]) / samples(); }
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

  // Mean gradient over the scenes from number `first`; their losses and noise scales, (batch) each.
  std::vector<float>& run(std::uint64_t first, std::vector<float>& losses, std::vector<float>& sigmas) {
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
            data_.append(options_.seed, first + static_cast<std::uint64_t>(i), input, target);
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
        "step,samples,seconds,samples_per_second,learning_rate,gradient_norm,loss,loss_low,loss_middle,loss_high,"
        "validation\n");
  std::fprintf(file, "%lld,%lld,%.1f,%.1f,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g\n", static_cast<long long>(r.step),
               static_cast<long long>(r.samples), r.seconds, r.samples_per_second, r.learning_rate, r.gradient_norm,
               r.loss, r.loss_by_noise[0], r.loss_by_noise[1], r.loss_by_noise[2], r.validation);
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
  if (std::isfinite(last.validation)) j["validation"] = last.validation;
  return j.dump();
}

// What the processes tell each other after every step, behind the gradient.
struct StepNews {
  LossMeter losses;
  double seconds = 0.0;  // of the first process
  bool stop = false;     // wanted by any

  static constexpr std::size_t kValues = 8;
  void append_to(std::vector<float>& values) const {
    for (std::size_t i = 0; i < 3; ++i) values.push_back(static_cast<float>(losses.sum[i]));
    for (std::size_t i = 0; i < 3; ++i) values.push_back(static_cast<float>(losses.count[i]));
    values.push_back(static_cast<float>(seconds));
    values.push_back(stop ? 1.0f : 0.0f);
  }
  void take_from(std::vector<float>& values) {
    const float* tail = values.data() + values.size() - kValues;
    for (std::size_t i = 0; i < 3; ++i) {
      losses.sum[i] = tail[i];
      losses.count[i] = tail[3 + i];
    }
    seconds = tail[6];
    stop = tail[7] > 0.0f;
    values.resize(values.size() - kValues);
  }
};

class TrainingRun {
 public:
  TrainingRun(const TrainingSet& data, const ModelConfig& config, const TrainOptions& options,
              const std::string& record, const TrainCallbacks& callbacks, Peers* peers)
      : data_(data),
        config_(config),
        options_(options),
        record_(record),
        callbacks_(callbacks),
        peers_(peers),
        network_(make_network(config)),
        workers_(data, *network_, options),
        checkpoint_path_(options.out + ".checkpoint"),
        log_path_(options.out + ".csv") {}

  TrainResult go() {
    begin();
    result_.last = make_report();
    save();  // an output that cannot be written fails now
    bool stopped = false;
    while (progress() < 1.0 && !stopped) {
      step(stopped);
      if (since(reported_) >= options_.report_seconds && progress() < 1.0) report();
      if (is_first() && since(saved_) >= options_.checkpoint_seconds) save();
      const bool due = options_.validate_minutes > 0 && since(validated_) >= 60.0 * options_.validate_minutes;
      if (due && progress() < 1.0) validate();
    }
    result_.finished = progress() >= 1.0;
    if (result_.finished) validate();
    if (meter_.steps > 0) report();
    save();
    return std::move(result_);
  }

 private:
  int processes() const { return peers_ ? peers_->count() : 1; }
  bool is_first() const { return !peers_ || peers_->rank() == 0; }

  double progress() const {
    double p = 0.0;
    if (options_.minutes > 0) p = std::max(p, run_.seconds / (60.0 * options_.minutes));
    if (options_.steps > 0) p = std::max(p, static_cast<double>(run_.state.step) / static_cast<double>(options_.steps));
    return std::min(p, 1.0);
  }

  // Fresh or from the checkpoint, and the same in all processes.
  void begin() {
    run_.config = config_;
    run_.seed = options_.seed;
    run_.batch = options_.batch * processes();
    run_.state =
        initial_state(options_.parameters.empty() ? network_->initial_parameters(options_.seed) : options_.parameters);
    if (options_.resume && is_first()) {
      Checkpoint left = read_checkpoint(network_->tensors(), checkpoint_path_);
      if (to_json(left.config) != to_json(config_) || left.seed != run_.seed || left.batch != run_.batch)
        throw InputError(checkpoint_path_ + ": left by a run with another configuration, seed or batch size");
      run_ = std::move(left);
    }
    if (!options_.resume && is_first()) {
      std::error_code ignored;
      std::filesystem::remove(log_path_, ignored);
    }
    if (options_.resume && peers_) share_state();
    seconds_before_ = run_.seconds;
    start_ = reported_ = saved_ = validated_ = Clock::now();
  }

  // The first process's state to the others: a sum in which theirs are zero.
  void share_state() {
    OptimizerState& state = run_.state;
    constexpr std::int64_t kHalf = 1 << 20;  // floats hold such numbers exactly
    std::vector<float> counters = {static_cast<float>(state.step / kHalf), static_cast<float>(state.step % kHalf),
                                   static_cast<float>(run_.seconds)};
    for (std::vector<float>* values : {&counters, &state.parameters, &state.average, &state.first, &state.second}) {
      if (!is_first()) std::fill(values->begin(), values->end(), 0.0f);
      peers_->sum(*values);
    }
    state.step = static_cast<std::int64_t>(counters[0]) * kHalf + static_cast<std::int64_t>(counters[1]);
    run_.seconds = counters[2];
  }

  void step(bool& stopped) {
    OptimizerState& state = run_.state;
    network_->set_parameters(state.parameters);
    const auto rank = static_cast<std::uint64_t>(peers_ ? peers_->rank() : 0);
    const auto batches = static_cast<std::uint64_t>(state.step) * static_cast<std::uint64_t>(processes()) + rank;
    std::vector<float>& gradient = workers_.run(batches * static_cast<std::uint64_t>(options_.batch), losses_, sigmas_);
    StepNews news;
    for (std::size_t i = 0; i < losses_.size(); ++i) news.losses.add(config_, sigmas_[i], losses_[i]);
    news.seconds = is_first() ? seconds_before_ + since(start_) : 0.0;
    news.stop = callbacks_.keep_going && !callbacks_.keep_going(result_.last);
    if (peers_) exchange(news, gradient);

    const double loss = news.losses.loss();
    if (!std::isfinite(loss))
      throw std::runtime_error("the loss is not finite at step " + std::to_string(state.step) +
                               "; the last good state is in " + checkpoint_path_);
    const double rate = learning_rate_factor(state.step, options_.warm_up, progress());
    meter_.norm += optimizer_step(options_.optimizer, network_->tensors(), rate, gradient, state, options_.threads);
    ++meter_.steps;
    meter_.add(news.losses);
    network_->get_state(state.parameters);
    network_->get_state(state.average);
    result_.losses.push_back(static_cast<float>(loss));
    run_.seconds = news.seconds;
    stopped = news.stop;
  }

  // The mean gradient and the sums of the news over all processes.
  void exchange(StepNews& news, std::vector<float>& gradient) {
    news.append_to(gradient);
    peers_->sum(gradient);
    news.take_from(gradient);
    const float share = 1.0f / static_cast<float>(processes());
    for (float& g : gradient) g *= share;
  }

  TrainReport make_report() const {
    TrainReport r;
    r.step = run_.state.step;
    r.samples = run_.state.step * run_.batch;
    r.seconds = run_.seconds;
    r.progress = progress();
    r.seconds_left = r.progress > 0 ? run_.seconds * (1.0 - r.progress) / r.progress : 0.0;
    r.samples_per_second = meter_.samples() / std::max(1e-9, since(reported_));
    r.learning_rate = options_.optimizer.learning_rate * learning_rate_factor(r.step, options_.warm_up, r.progress);
    r.gradient_norm = meter_.norm / static_cast<double>(std::max<std::int64_t>(1, meter_.steps));
    for (std::size_t i = 0; i < 3; ++i) r.loss_by_noise[i] = meter_.sum[i] / meter_.count[i];  // NaN if none
    r.loss = meter_.loss();
    r.validation = validation_;
    return r;
  }

  void report() {
    result_.last = make_report();
    if (is_first()) {
      append_log(log_path_, result_.last);
      if (callbacks_.report) callbacks_.report(result_.last);
    }
    meter_ = {};
    reported_ = Clock::now();
  }

  void validate() {
    if (callbacks_.validate && is_first()) validation_ = callbacks_.validate(config_, run_.state.average);
    validated_ = Clock::now();
  }

  void save() {
    if (!is_first()) return;
    write_checkpoint(run_, network_->tensors(), checkpoint_path_);
    write_model({config_, training_record(record_, options_, result_.last, data_.scenes()), run_.state.average},
                options_.out);
    saved_ = Clock::now();
  }

  const TrainingSet& data_;
  const ModelConfig& config_;
  const TrainOptions& options_;
  const std::string& record_;
  const TrainCallbacks& callbacks_;
  Peers* peers_;
  std::unique_ptr<Network> network_;
  GradientWorkers workers_;
  std::string checkpoint_path_, log_path_;
  Checkpoint run_;
  double seconds_before_ = 0.0;
  Clock::time_point start_, reported_, saved_, validated_;
  LossMeter meter_;
  double validation_ = std::numeric_limits<double>::quiet_NaN();
  std::vector<float> losses_, sigmas_;
  TrainResult result_;
};

}  // namespace

TrainResult train(const TrainingSet& data, const ModelConfig& config, const TrainOptions& options,
                  const std::string& record, const TrainCallbacks& callbacks, Peers* peers) {
  if (options.minutes <= 0 && options.steps <= 0) throw InputError("training needs --minutes or --steps");
  if (options.batch < 1 || options.micro_batch < 1 || options.threads < 1)
    throw InputError("batch, micro batch and threads must be at least 1");
  if (const std::size_t given = options.parameters.size();
      given > 0 && given != static_cast<std::size_t>(make_network(config)->parameter_count()))
    throw InputError("the parameters to begin with are not as many as the network has");
  return TrainingRun(data, config, options, record, callbacks, peers).go();
}

}  // namespace dofusion
