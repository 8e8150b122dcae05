#include "apps/shared_work.h"

#include <map>
#include <numeric>

#include <gtest/gtest.h>

#include "stability/files.h"

namespace dofusion {
namespace {

SharedWork squares(std::int64_t count, std::map<std::int64_t, std::string>& results) {
  SharedWork shared;
  shared.items.resize(static_cast<std::size_t>(count));
  std::iota(shared.items.begin(), shared.items.end(), 100);
  shared.work = [](std::int64_t item, int) { return std::to_string(item * item); };
  shared.collect = [&results](std::int64_t item, const std::string& result) {
    EXPECT_TRUE(results.emplace(item, result).second) << item << " came twice";
  };
  shared.threads = 3;
  return shared;
}

TEST(ShareWork, EveryItemIsDoneOnce) {
  Ranks ranks;
  EXPECT_TRUE(ranks.first());
  EXPECT_EQ(ranks.count(), 1);
  std::map<std::int64_t, std::string> results;
  share_work(ranks, squares(500, results));
  ASSERT_EQ(results.size(), 500u);
  for (const auto& [item, result] : results) EXPECT_EQ(result, std::to_string(item * item));
}

TEST(ShareWork, NothingToDoIsDone) {
  Ranks ranks;
  std::map<std::int64_t, std::string> results;
  share_work(ranks, squares(0, results));
  EXPECT_TRUE(results.empty());
}

TEST(ShareWork, TheFirstExceptionStopsAllAndIsThrown) {
  Ranks ranks;
  std::map<std::int64_t, std::string> results;
  SharedWork shared = squares(1'000'000, results);
  shared.work = [](std::int64_t item, int) -> std::string {
    if (item == 150) throw InputError("item 150");
    return "";
  };
  EXPECT_THROW(share_work(ranks, shared), InputError);
  EXPECT_LT(results.size(), 1'000'000u);
  shared = squares(100, results);
  shared.collect = [](std::int64_t, const std::string&) { throw std::runtime_error("full"); };
  EXPECT_THROW(share_work(ranks, shared), std::runtime_error);
}

}  // namespace
}  // namespace dofusion
