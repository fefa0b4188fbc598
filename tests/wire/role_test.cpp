// Roles have one name each, wherever people meet them.

#include "common/wire/role.h"

#include <gtest/gtest.h>

#include "proto/wire.pb.h"

namespace trocar::wire {
namespace {

TEST(Roles, NamesAndNumbersAreThoseOfTheProtocol) {
  for (int number = 1; number < proto::Role_ARRAYSIZE; ++number) {
    const std::string name = name_of(role_of(number));
    std::string in_protocol = proto::Role_Name(number);
    for (char& c : in_protocol)
      if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    EXPECT_EQ("role_" + name, in_protocol);
  }
  EXPECT_EQ(list_roles(), "surgeon (1), assistant (2), instructor (3), observer (4)");
}

TEST(Roles, AnUnknownNumberIsUnknownAndHasNoTools) {
  for (const int number : {-1, 0, 5, 256, 257}) {
    EXPECT_EQ(role_of(number), Role::Unknown) << number;
    EXPECT_FALSE(has_tools(role_of(number))) << number;
    EXPECT_FALSE(rights_of(role_of(number)).may_have_tools) << number;
  }
  EXPECT_STREQ(name_of(Role::Unknown), "unknown role");
}

TEST(Roles, EachHasItsArticle) {
  EXPECT_EQ(one_of(Role::Surgeon), "a surgeon");
  EXPECT_EQ(one_of(Role::Assistant), "an assistant");
  EXPECT_EQ(one_of(Role::Instructor), "an instructor");
  EXPECT_EQ(one_of(Role::Observer), "an observer");
}

}  // namespace
}  // namespace trocar::wire
