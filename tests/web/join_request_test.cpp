#include "server/watch/page/join_request.h"

#include <gtest/gtest.h>

#include "common/secure/join_code.h"
#include "proto/wire.pb.h"
#include "server/watch/page/page_messages.h"

namespace trocar::page {
namespace {

std::optional<JoinRefusal> read(const std::string& text, JoinRequest& request) {
  return read_join_request(bytes_of(text), request);
}

TEST(JoinRequest, BecomesAHello) {
  JoinRequest request;
  const auto refusal = read(
      R"({"code": "7K3M-9QXZ-4T2B-WN8C", "name": "Ann", "role": "instructor", "token": "000102030405060708090a0b0c0d0e0f"})",
      request);
  ASSERT_FALSE(refusal) << refusal->text;
  const auto frame = hello_of(request);
  proto::Envelope envelope;
  ASSERT_TRUE(wire::decode_envelope(BytesView(*frame).subspan(wire::kHeaderBytes), envelope).ok());
  EXPECT_EQ(envelope.hello().name(), "Ann");
  EXPECT_EQ(envelope.hello().role(), proto::ROLE_INSTRUCTOR);
  EXPECT_EQ(envelope.hello().join_secret().size(), 5u);
  EXPECT_EQ(envelope.hello().return_token().size(), 16u);
  EXPECT_TRUE(envelope.hello().acks_every_frame());
  EXPECT_EQ(envelope.hello().tool_size(), 0);
}

TEST(JoinRequest, OfASurgeonBringsInstruments) {
  JoinRequest request;
  const auto refusal = read(
      R"({"code": "7K3M-9QXZ-4T2B-WN8C", "name": "Sue", "role": "surgeon", "tools": ["grasper", "scissors"]})",
      request);
  ASSERT_FALSE(refusal) << refusal->text;
  const auto frame = hello_of(request);
  proto::Envelope envelope;
  ASSERT_TRUE(wire::decode_envelope(BytesView(*frame).subspan(wire::kHeaderBytes), envelope).ok());
  EXPECT_EQ(envelope.hello().role(), proto::ROLE_SURGEON);
  ASSERT_EQ(envelope.hello().tool_size(), 2);
  EXPECT_EQ(envelope.hello().tool(0).form(), proto::TOOL_FORM_GRASPER);
  EXPECT_EQ(envelope.hello().tool(1).form(), proto::TOOL_FORM_SCISSORS);
}

TEST(PageMessage, OfAToolIsForRolesThatMayHaveSome) {
  proto::Envelope said, read;
  said.mutable_tool_sample()->set_sequence(1);
  const std::string text = said.SerializeAsString();
  const auto bytes = bytes_of(text);
  for (const auto& role : wire::kRoles)
    EXPECT_EQ(read_page_message(bytes, role.role, read), role.rights.may_have_tools) << role.name;
}

TEST(JoinRequest, OfAnotherFormIsRefused) {
  JoinRequest request;
  for (
      const auto* text :
      {"", "[]", "null", "{", "{\"name\": \"Ann\"}", "\xff\xfe", "{\"role\": 4}",
       R"({"role": "root", "code": "7K3M-9QXZ-4T2B-WN8C", "name": "Ann"})",
       R"({"role": "observer", "code": "7K3M-9QXZ-4T2B-WN8C", "tools": ["probe"]})",
       R"({"role": "surgeon", "code": "7K3M-9QXZ-4T2B-WN8C", "tools": ["chainsaw"]})",
       R"({"role": "surgeon", "code": "7K3M-9QXZ-4T2B-WN8C", "tools": [1]})",
       R"({"role": "surgeon", "code": "7K3M-9QXZ-4T2B-WN8C", "tools": ["probe", "probe", "probe"]})",
       R"({"role": "observer", "code": "7K3M-9QXZ-4T2B-WN8C", "token": "00"})"}) {
    const auto refusal = read(text, request);
    ASSERT_TRUE(refusal) << text;
    EXPECT_EQ(refusal->fault, JoinFault::Form) << text;
  }
  EXPECT_TRUE(read("{\"name\": \"" + std::string(kMostJoinBytes, 'a') + "\"}", request));
  const std::string nested(1500, '[');
  EXPECT_TRUE(read(nested, request));
}

TEST(JoinRequest, AWrongCodeCountsAsATry) {
  JoinRequest request;
  for (const auto* code : {"", "7K3M", "7K3M-9QXZ-4T2B-WN8C-1", "7K3M-9QXZ-4T2B-WN8U"}) {
    const auto refusal =
        read("{\"role\": \"observer\", \"name\": \"A\", \"code\": \"" + std::string(code) + "\"}",
             request);
    ASSERT_TRUE(refusal) << code;
    EXPECT_EQ(refusal->fault, JoinFault::Code) << code;
  }
}

TEST(JoinRequest, OfAPageThatComesBackIsTriedAgainWhileItsSessionIsAway) {
  JoinRequest request;
  EXPECT_EQ(reason_to_wait(request, wire::EndReason::Full), wire::EndReason::Full);
  request.return_token = Bytes(16, 1);
  EXPECT_EQ(reason_to_wait(request, wire::EndReason::Full), wire::EndReason::Timeout);
}

}  // namespace
}  // namespace trocar::page
