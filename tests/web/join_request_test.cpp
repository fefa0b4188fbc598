#include "server/watch/page/join_request.h"

#include <gtest/gtest.h>

#include "common/secure/join_code.h"
#include "proto/wire.pb.h"

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

TEST(JoinRequest, OfAnotherFormIsRefused) {
  JoinRequest request;
  for (const auto* text :
       {"", "[]", "null", "{", "{\"name\": \"Ann\"}", "\xff\xfe", "{\"role\": 4}",
        R"({"role": "surgeon", "code": "7K3M-9QXZ-4T2B-WN8C", "name": "Ann"})",
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
