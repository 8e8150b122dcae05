#include "apps/html.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace dofusion {
namespace {

TEST(Base64, TestVectorsOfRfc4648) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("foob"), "Zm9vYg==");
  EXPECT_EQ(base64("fooba"), "Zm9vYmE=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(base64(std::string("\xff\xfe\x00\x80", 4)), "//4AgA==");  // bytes are not characters
}

TEST(Html, TextCannotBecomeMarkup) {
  EXPECT_EQ(html_escaped("<a href=\"x\">&</a>"), "&lt;a href=&quot;x&quot;&gt;&amp;&lt;/a&gt;");
  EXPECT_THAT(embedded_image("\xff\xd8x", "a"), testing::HasSubstr("data:image/jpeg;base64,/9h4"));
  EXPECT_THAT(embedded_image("\x89PNG", "a"), testing::HasSubstr("data:image/png;base64,"));
  EXPECT_THAT(embedded_image("x", "\"><script>"), testing::Not(testing::HasSubstr("<script>")));
  EXPECT_THAT(html_begin("a<b"), testing::HasSubstr("<title>a&lt;b</title>"));
}

}  // namespace
}  // namespace dofusion
