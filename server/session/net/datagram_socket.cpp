#include "server/session/net/datagram_socket.h"

#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstring>

namespace trocar::net {
namespace {

using asio::ip::udp;

// Room for one note of an address.
struct alignas(cmsghdr) Note {
  std::array<char, CMSG_SPACE(sizeof(in6_pktinfo))> bytes{};
};

asio::ip::address local_of(msghdr& message) {
  for (auto* note = CMSG_FIRSTHDR(&message); note != nullptr; note = CMSG_NXTHDR(&message, note)) {
    if (note->cmsg_level == IPPROTO_IP && note->cmsg_type == IP_PKTINFO) {
      in_pktinfo info{};
      std::memcpy(&info, CMSG_DATA(note), sizeof info);
      return asio::ip::address_v4(ntohl(info.ipi_addr.s_addr));
    }
    if (note->cmsg_level == IPPROTO_IPV6 && note->cmsg_type == IPV6_PKTINFO) {
      in6_pktinfo info{};
      std::memcpy(&info, CMSG_DATA(note), sizeof info);
      asio::ip::address_v6::bytes_type bytes{};
      std::memcpy(bytes.data(), &info.ipi6_addr, bytes.size());
      return asio::ip::address_v6(bytes);
    }
  }
  return {};
}

template <typename Info>
void add_note(msghdr& message, Note& room, int level, int type, const Info& info) {
  message.msg_control = room.bytes.data();
  message.msg_controllen = CMSG_SPACE(sizeof info);
  auto* note = CMSG_FIRSTHDR(&message);
  note->cmsg_level = level;
  note->cmsg_type = type;
  note->cmsg_len = CMSG_LEN(sizeof info);
  std::memcpy(CMSG_DATA(note), &info, sizeof info);
}

}  // namespace

bool ask_for_local_addresses(udp::socket& socket) {
  const int on = 1;
  boost::system::error_code ignored;
  const bool is_v4 = socket.local_endpoint(ignored).protocol() == udp::v4();
  return ::setsockopt(socket.native_handle(), is_v4 ? IPPROTO_IP : IPPROTO_IPV6,
                      is_v4 ? IP_PKTINFO : IPV6_RECVPKTINFO, &on, sizeof on) == 0;
}

std::optional<Arrival> receive_datagram(udp::socket& socket, std::span<std::uint8_t> room) {
  Arrival arrival;
  Note note;
  iovec where{room.data(), room.size()};
  msghdr message{};
  message.msg_name = arrival.peer.data();
  message.msg_namelen = static_cast<socklen_t>(arrival.peer.capacity());
  message.msg_iov = &where;
  message.msg_iovlen = 1;
  message.msg_control = note.bytes.data();
  message.msg_controllen = note.bytes.size();
  const auto count = ::recvmsg(socket.native_handle(), &message, MSG_DONTWAIT);
  if (count < 0) return std::nullopt;
  arrival.peer.resize(message.msg_namelen);
  arrival.local = local_of(message);
  arrival.bytes = static_cast<std::size_t>(count);
  return arrival;
}

bool send_datagram(udp::socket& socket, BytesView datagram, const udp::endpoint& peer,
                   const asio::ip::address& local) {
  Note note;
  // The system only reads what these point to.
  iovec where{const_cast<std::uint8_t*>(datagram.data()), datagram.size()};
  msghdr message{};
  message.msg_name = const_cast<void*>(static_cast<const void*>(peer.data()));
  message.msg_namelen = static_cast<socklen_t>(peer.size());
  message.msg_iov = &where;
  message.msg_iovlen = 1;
  if (local.is_v4() && !local.is_unspecified()) {
    in_pktinfo info{};
    info.ipi_spec_dst.s_addr = htonl(local.to_v4().to_uint());
    add_note(message, note, IPPROTO_IP, IP_PKTINFO, info);
  } else if (local.is_v6() && !local.is_unspecified()) {
    in6_pktinfo info{};
    const auto bytes = local.to_v6().to_bytes();
    std::memcpy(&info.ipi6_addr, bytes.data(), bytes.size());
    add_note(message, note, IPPROTO_IPV6, IPV6_PKTINFO, info);
  }
  return ::sendmsg(socket.native_handle(), &message, MSG_DONTWAIT | MSG_NOSIGNAL) >= 0;
}

}  // namespace trocar::net
