// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/pipeline.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <deque>
#include <limits>
#include <mutex>
#include <span>
#include <system_error>
#include <thread>
#include <utility>

#include "diorama/error.h"
#include "framework/host/stoppable.h"
#include "framework/pipeline/scene_setup.h"
#include "framework/pipeline/stopwatch.h"
#include "framework/plugins/plugin_call.h"

namespace diorama {
namespace {

// More of them than of other threads would only wait: encoding takes seats of the pool.
constexpr int kMostWritingThreads = 16;
// Visits that are begun, per set of components, before the first of them has ended: what runs ahead
// of a slow one is published late, and lost when the process is killed. Few visits take ten times
// as long as others; with two, all threads stood idle behind them.
constexpr int kTurnsAhead = 8;
// Whoever asks to stop cannot notify.
constexpr std::chrono::milliseconds kLook{100};

std::string duration_text(double seconds) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f s", seconds);
  return text;
}

}  // namespace

/// A visit under way. Turns are numbered in the order in which one visit after the other would be
/// made.
struct Pipeline::Turn {
  int number = 0;
  PlannedVisit visit;
  /// Becomes true when an earlier turn has failed: this one would never have begun.
  const std::atomic<bool>* is_cancelled = nullptr;
};

/// Which visits are under way, and what the ended ones left. All of it is guarded by the mutex.
struct Pipeline::Flight {
  struct Begun {
    std::atomic<bool> is_cancelled = false;
    int respawned = 0;
    std::map<std::string, double> seconds;
    std::int64_t refused = 0;
  };
  struct Call {
    const std::function<void()>* function = nullptr;
    std::exception_ptr error;
    bool is_done = false;
  };

  std::mutex mutex;
  std::condition_variable changed;
  int next_index = 0;  ///< Of planned visits; not with takes_visits.
  int next_turn = 0;
  int first_under_way = 0;  ///< All turns before it have ended well.
  bool begins_no_more = false;
  std::map<int, Begun> begun;  ///< By turn; those before first_under_way are added up and gone.
  std::map<int, VisitResult> ended;  ///< By turn, behind first_under_way.
  std::map<int, std::exception_ptr> errors;
  bool has_begun = false;  ///< The output.
  int threads = 0;         ///< Still taking turns.
  std::deque<Call*> calls;
};

Pipeline::Pipeline(const Job& job, const CapturePlan& plan, JobComponents& components,
                   HostServices& host, OutputStore& store, RunOptions options)
    : job_(job),
      plan_(plan),
      components_(components),
      host_(host),
      store_(store),
      options_(std::move(options)),
      streams_(job.seed),
      environment_patterns_(components.environment_patterns, job.environment.unmatched == "error"),
      flight_(std::make_unique<Flight>()) {}

Pipeline::~Pipeline() = default;

RunSummary Pipeline::run(const DatasetInfo& dataset, const std::string& dataset_json) {
  dataset_ = &dataset;
  dataset_json_ = &dataset_json;
  summary_.cameras = int(dataset.camera_names.size());
  {
    const Stopwatch all(summary_.wall_s);
    store_.join(dataset_json);
    for_each_visit([&](const PlannedVisit& visit) {
      total_ += visit.capture_count;
      for (int i = 0; i < visit.capture_count; ++i) {
        summary_.resumed += store_.is_done(visit.first_capture + i) ? 1 : 0;
      }
    });
    WriterQueue::Options queue;
    queue.threads = std::clamp(host_.thread_count(), 1, kMostWritingThreads);
    queue.max_bytes = options_.queue_bytes;
    queue.pool = &host_.pool();
    queue.encodes_ahead = !options_.encodes_in_order;
    queue_ = std::make_unique<WriterQueue>(
        queue, WriterQueue::Work{[this](const PendingCapture& pending) { return encode(pending); },
                                 [this](int capture, Transaction& transaction) {
                                   store_.commit_capture(capture, transaction);
                                   ++written_;
                                 }});
    try {
      run_visits();
      const Stopwatch watch(summary_.seconds["waiting for writers"]);
      const auto look = [this] {
        tell_written();
        return options_.stop && *options_.stop;
      };
      if (!queue_->drain(look)) throw Interrupted();
      tell_written();
    } catch (const Interrupted&) {
      end_early();
      throw;
    } catch (const Stopped&) {
      end_early();
      throw Interrupted();
    } catch (...) {
      // What was made before the error is whole. An error in writing it was there first.
      queue_->drop_later_turns();
      queue_->drain();
      throw;
    }
    finish_output(dataset);
    store_.close();
  }
  summary_.bytes_written = store_.bytes_written();
  return std::move(summary_);
}

void Pipeline::for_each_visit(const std::function<void(const PlannedVisit&)>& visit) const {
  for (int i = 0; i < plan_.visit_count(); ++i) {
    const bool is_own = options_.takes_visits || is_in_shard(i, options_.shard, options_.shards);
    if (is_own) visit(plan_.visit(i));
  }
}

void Pipeline::run_visits() {
  if (options_.only_finishes) return;
  if (components_.sets.size() == 1) {
    take_turns(components_.sets.front());
  } else {
    std::vector<std::thread> threads;
    for (VisitComponents& components : components_.sets) {
      const std::lock_guard lock(flight_->mutex);
      ++flight_->threads;
      try {
        threads.emplace_back([this, &components] {
          take_turns(components);
          const std::lock_guard at_end(flight_->mutex);
          --flight_->threads;
          flight_->changed.notify_all();
        });
      } catch (const std::system_error&) {
        // The system gives no more of them; those that there are take all turns.
        --flight_->threads;
        if (threads.empty()) throw;
        break;
      }
    }
    serve_visits();
    for (std::thread& thread : threads) thread.join();
  }
  if (!flight_->errors.empty()) std::rethrow_exception(flight_->errors.begin()->second);
}

/// Until there are no more. Throws nothing.
void Pipeline::take_turns(VisitComponents& components) {
  const bool is_alone = components_.sets.size() == 1;
  while (true) {
    std::optional<Turn> turn;
    try {
      turn = next_turn();
    } catch (...) {
      const std::lock_guard lock(flight_->mutex);
      flight_->begins_no_more = true;
      flight_->errors.emplace(flight_->next_turn++, std::current_exception());
      flight_->changed.notify_all();
    }
    if (!turn) return;
    std::optional<ThreadPool::Seat> seat;
    // Writers come first, then visits in their order.
    if (!is_alone) seat.emplace(host_.pool(), 1 + turn->number);
    try {
      end_turn(*turn, run_visit(*turn, components));
    } catch (...) {
      fail_turn(*turn, std::current_exception());
    }
  }
}

std::optional<Pipeline::Turn> Pipeline::next_turn() {
  std::unique_lock lock(flight_->mutex);
  const int most = kTurnsAhead * int(components_.sets.size());
  flight_->changed.wait(lock, [&] {
    return flight_->begins_no_more || flight_->next_turn - flight_->first_under_way < most;
  });
  if (flight_->begins_no_more) return std::nullopt;
  const std::optional<PlannedVisit> visit = next_visit();
  if (!visit) return std::nullopt;
  const int number = flight_->next_turn++;
  return Turn{number, *visit, &flight_->begun[number].is_cancelled};
}

/// With the mutex held.
std::optional<PlannedVisit> Pipeline::next_visit() {
  if (options_.takes_visits) {
    const auto needs_work = [&](int visit) { return is_needed(plan_.visit(visit)); };
    const std::optional<int> claimed = store_.claim_visit(plan_.visit_count(), needs_work);
    return claimed ? std::optional(plan_.visit(*claimed)) : std::nullopt;
  }
  while (flight_->next_index < plan_.visit_count()) {
    const int index = flight_->next_index++;
    if (!is_in_shard(index, options_.shard, options_.shards)) continue;
    if (const PlannedVisit visit = plan_.visit(index); is_needed(visit)) return visit;
  }
  return std::nullopt;
}

VisitResult Pipeline::run_visit(const Turn& turn, VisitComponents& components) {
  const Stoppable stoppable(*turn.is_cancelled);
  VisitRun::Setting setting{
      job_, plan_, streams_, components_, environment_patterns_, components, host_, {}, {}, {}, {}};
  setting.is_needed = [this](int capture) {
    const std::lock_guard lock(flight_->mutex);
    return is_needed(capture);
  };
  setting.stop_if_asked = [&] {
    if (has_to_stop(turn)) throw Interrupted();
  };
  setting.before_capture = [&] { wait_for_output(turn); };
  setting.hand_over = [&](PendingCapture pending, const VisitResult& result) {
    hand_over(turn, std::move(pending), result);
  };
  return VisitRun(std::move(setting), turn.visit).run();
}

bool Pipeline::has_to_stop(const Turn& turn) const {
  return (options_.stop && *options_.stop) || *turn.is_cancelled;
}

void Pipeline::end_turn(const Turn& turn, VisitResult result) {
  const std::lock_guard lock(flight_->mutex);
  flight_->ended.emplace(turn.number, std::move(result));
  while (!flight_->ended.empty() && flight_->ended.begin()->first == flight_->first_under_way) {
    add_up(std::move(flight_->ended.extract(flight_->ended.begin()).mapped()));
    flight_->begun.erase(flight_->first_under_way++);
  }
  queue_->let_through(flight_->first_under_way);
  flight_->changed.notify_all();
}

/// Earlier turns go on, as one of them may fail, too; later ones would never have begun.
void Pipeline::fail_turn(const Turn& turn, std::exception_ptr error) {
  const std::lock_guard lock(flight_->mutex);
  flight_->begins_no_more = true;
  if (!*turn.is_cancelled) flight_->errors.emplace(turn.number, std::move(error));
  for (auto& [number, begun] : flight_->begun) {
    if (number > turn.number) begun.is_cancelled = true;
  }
  flight_->changed.notify_all();
}

void Pipeline::add_up(VisitResult result) {
  summary_.captures += result.captures;
  summary_.respawned += result.respawned;
  for (const VisitReport& report : result.reports) summary_.settled.add(report);
  for (const auto& [capture, outcomes] : result.views) summary_.views.add(capture, outcomes);
  for (const auto& [phase, seconds] : result.seconds) summary_.seconds[phase] += seconds;
}

/// The output begins with the first capture that would be made one visit after the other: a job
/// that fails before it leaves nothing.
void Pipeline::wait_for_output(const Turn& turn) {
  {
    const std::lock_guard lock(flight_->mutex);
    if (flight_->has_begun) return;
  }
  {
    const ThreadPool::Rest rest(host_.pool());
    std::unique_lock lock(flight_->mutex);
    const auto is_over = [&] {
      return flight_->has_begun || flight_->first_under_way == turn.number;
    };
    while (!flight_->changed.wait_for(lock, kLook, is_over)) {
      if (has_to_stop(turn)) throw Interrupted();
    }
    if (flight_->has_begun) return;
  }
  call_on_main_thread([this] { begin_output(); });
  const std::lock_guard lock(flight_->mutex);
  flight_->has_begun = true;
  flight_->changed.notify_all();
}

void Pipeline::hand_over(const Turn& turn, PendingCapture pending, const VisitResult& result) {
  pending.turn = turn.number;
  if (!queue_->push(std::move(pending), [&] { return has_to_stop(turn); })) throw Interrupted();
  call_on_main_thread([&] {
    RunProgress progress;
    std::map<std::string, double> seconds;
    {
      const std::lock_guard lock(flight_->mutex);
      Flight::Begun& own = flight_->begun[turn.number];
      own.respawned = result.respawned;
      own.seconds = result.seconds;
      seconds = summary_.seconds;
      own.refused = result.refused;
      progress = {summary_.resumed + written_, total_, summary_.resumed, summary_.respawned,
                  summary_.views.refused_draws()};
      for (const auto& [number, begun] : flight_->begun) {
        progress.respawned += begun.respawned;
        for (const auto& [stage, time] : begun.seconds) seconds[stage] += time;
        progress.refused += begun.refused;
      }
    }
    store_.tell_times(seconds);
    told_ = progress;
    if (options_.progress) options_.progress(progress);
  });
}

/// Once all visits have ended; says nothing when nothing was written since it was said last.
void Pipeline::tell_written() {
  RunProgress progress{0, total_, summary_.resumed, 0, 0};
  if (told_) progress = *told_;
  progress.done = summary_.resumed + written_;
  if (told_ && told_->done == progress.done) return;
  told_ = progress;
  if (options_.progress) options_.progress(progress);
}

/// Waits for its end; throws what it throws. Visits that are alone are on that thread already.
void Pipeline::call_on_main_thread(const std::function<void()>& call) {
  if (components_.sets.size() == 1) return call();
  Flight::Call wanted;
  wanted.function = &call;
  const ThreadPool::Rest rest(host_.pool());
  std::unique_lock lock(flight_->mutex);
  flight_->calls.push_back(&wanted);
  flight_->changed.notify_all();
  flight_->changed.wait(lock, [&] { return wanted.is_done; });
  if (wanted.error) std::rethrow_exception(wanted.error);
}

/// Makes their calls until no visit is under way.
void Pipeline::serve_visits() {
  const ThreadPool::Rest rest(host_.pool());
  std::unique_lock lock(flight_->mutex);
  while (true) {
    flight_->changed.wait(lock, [&] { return flight_->threads == 0 || !flight_->calls.empty(); });
    if (flight_->calls.empty()) return;
    Flight::Call* const call = flight_->calls.front();
    flight_->calls.pop_front();
    lock.unlock();
    std::exception_ptr error;
    try {
      (*call->function)();
    } catch (...) {
      error = std::current_exception();
    }
    lock.lock();
    call->error = std::move(error);
    call->is_done = true;
    flight_->changed.notify_all();
  }
}

/// Keeps what is whole, and does not begin what a slow disk would hold up: who asked may not wait.
void Pipeline::end_early() {
  queue_->drop_waiting();
  queue_->drain();
  tell_written();
  store_.close();
}

bool Pipeline::is_needed(const PlannedVisit& planned) const {
  for (int i = 0; i < planned.capture_count; ++i) {
    if (is_needed(planned.first_capture + i)) return true;
  }
  return false;
}

bool Pipeline::is_needed(int capture) const {
  return !store_.is_done(capture) && (!options_.only || options_.only->contains(capture));
}

void Pipeline::begin_output() {
  store_.open();
  Transaction transaction = store_.begin_transaction();
  for (std::size_t i = 0; i < components_.writers.size(); ++i) {
    const std::string& name = job_.writers[i].name;
    CollectedFiles files(transaction, i, name);
    call_component("writer '" + name + "'",
                   [&] { components_.writers[i]->begin(*dataset_, files); });
  }
  store_.commit_begin(transaction);
}

Transaction Pipeline::encode(const PendingCapture& pending) {
  Transaction transaction = store_.capture_transaction(pending.capture.index);
  for (std::size_t i = 0; i < components_.writers.size(); ++i) {
    const std::string& name = job_.writers[i].name;
    CollectedFiles files(transaction, i, name);
    call_component("writer '" + name + "'",
                   [&] { components_.writers[i]->write(pending.capture, files); });
  }
  const std::string visit_name = std::to_string(pending.capture.visit) + "_" +
                                 node_name(asset_stem(pending.capture.environment));
  if (!pending.settle_json.empty()) {
    const auto text = std::as_bytes(std::span(pending.settle_json));
    transaction.files.push_back(
        {kRecordsFolder, "settle/" + visit_name + ".json", {text.begin(), text.end()}});
  }
  if (!pending.views_json.empty()) {
    transaction.records.emplace_back(kRecordsFolder, pending.views_json);
  }
  if (const auto& overview = pending.overview; overview.width() > 0) {
    const ImageView view{overview.pixels().data(), overview.width(), overview.height(), 4, 8};
    transaction.files.push_back({kRecordsFolder, "overview/" + visit_name + ".png",
                                 host_.encode_image(view, ImageFormat::Png)});
  }
  return transaction;
}

void Pipeline::finish_output(const DatasetInfo& dataset) {
  const Stopwatch watch(summary_.seconds["finishing"]);
  store_.refresh();
  summary_.missing = dataset.capture_count - store_.done_count();
  summary_.is_finished = store_.is_finished();
  if (summary_.missing > 0 || summary_.is_finished) return;
  // Who loses this claim to another worker has done its part; the other one's is to finish.
  if (!flight_->has_begun) begin_output();
  if (!store_.claim_finish()) {
    summary_.is_finished = store_.is_finished();
    return;
  }
  Transaction transaction = store_.finish_transaction();
  for (std::size_t i = 0; i < components_.writers.size(); ++i) {
    const std::string& name = job_.writers[i].name;
    CollectedFiles files(transaction, i, name);
    const RecordReader records = [&](const RecordVisitor& visitor) {
      store_.read_records(i, visitor);
    };
    call_component("writer '" + name + "'",
                   [&] { components_.writers[i]->finish(records, files); });
  }
  if (!job_.views.empty()) {
    ViewCounts counts;
    store_.read_records(kRecordsFolder, [&](int capture, std::string_view line) {
      counts.add(capture, outcomes_from_json(line));
    });
    const std::string text = views_json(counts);
    const auto bytes = std::as_bytes(std::span(text));
    transaction.files.push_back({kRecordsFolder, kViewsFile, {bytes.begin(), bytes.end()}});
  }
  store_.commit_finish(transaction);
  summary_.is_finished = store_.is_finished();
}

std::string summary_text(const RunSummary& summary) {
  std::string text;
  for (const auto& [phase, seconds] : summary.seconds) {
    if (seconds < 0.05) continue;
    text += (text.empty() ? "time: " : ", ") + phase + " " + duration_text(seconds);
  }
  if (!text.empty()) text += "\n";
  text += summary.settled.text();
  text += views_text(summary.views);
  char line[64];
  std::snprintf(line, sizeof line, "%.1f MB written", double(summary.bytes_written) * 1e-6);
  text += line;
  text += " in " + duration_text(summary.wall_s) + "\n";
  if (summary.resumed > 0) {
    text += std::to_string(summary.resumed) + " captures were there before\n";
  }
  text += "Finished, captured " + std::to_string(summary.captures * summary.cameras) + " frames (" +
          std::to_string(summary.captures) + " captures x " + std::to_string(summary.cameras) +
          " cameras)";
  if (!summary.is_finished) {
    text += "; this part is done, ";
    text += summary.missing > 0 ? "the dataset lacks " + std::to_string(summary.missing) +
                                      " captures of other workers"
                                : "another worker finishes the dataset";
  }
  return text;
}

}  // namespace diorama
