// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/socket_layer.h"

#include <csignal>
#include <unistd.h>
#include <utility>

#include "absl/base/thread_annotations.h"
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/dul.h>
#include <dcmtk/ofstd/ofstd.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/time.h>

#include "client/pacs_bridge/dicom/dicom_file.h"
#include "core/base/mutex.h"

namespace tissueform {
namespace {

// DCMTK takes a socket that is there from one variable of the process. It is held until the
// socket has been taken from there, which is before the first byte is read.
class Handover {
 public:
  explicit Handover(int socket) ABSL_NO_THREAD_SAFETY_ANALYSIS {
    ProcessMutex().Lock();
    dcmExternalSocketHandle.set(socket);
  }
  ~Handover() { Done(); }
  Handover(const Handover&) = delete;
  Handover& operator=(const Handover&) = delete;

  void Done() ABSL_NO_THREAD_SAFETY_ANALYSIS {
    if (std::exchange(done_, true)) return;
    dcmExternalSocketHandle.set(DCMNET_INVALID_SOCKET);
    ProcessMutex().Unlock();
  }
  bool done() const { return done_; }

 private:
  static Mutex& ProcessMutex() {
    static Mutex mutex;
    return mutex;
  }

  bool done_ = false;
};

}  // namespace

absl::Status PrepareDicomNetwork() {
  static const bool once = [] {
    std::signal(SIGPIPE, SIG_IGN);
    dcmDisableGethostbyaddr.set(OFTrue);
    // What comes is kept as it is.
    dcmEnableAutomaticInputDataCorrection.set(OFFalse);
    OFStandard::initializeNetwork();
    return true;
  }();
  static_cast<void>(once);
  return PrepareDcmtk();
}

void SetSilence(int socket, std::chrono::seconds silence) {
  timeval time = {};
  time.tv_sec = silence.count();
  setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &time, sizeof(time));
  setsockopt(socket, SOL_SOCKET, SO_SNDTIMEO, &time, sizeof(time));
}

SocketLayer::SocketLayer(DcmTransportLayer* secure, std::chrono::seconds silence,
                         std::function<void()> connected)
    : secure_(secure), silence_(silence), connected_(std::move(connected)) {}

DcmTransportConnection* SocketLayer::createConnection(DcmNativeSocketType socket,
                                                      OFBool /*is_secure*/) {
  has_socket_ = true;
  const int on = 1;
  setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
  DcmTransportConnection* connection = secure_ == nullptr
                                           ? plain_.createConnection(socket, OFFalse)
                                           : secure_->createConnection(socket, OFTrue);
  SetSilence(socket, silence_);  // DCMTK's connection has set times of its own
  if (connected_) connected_();
  return connection;
}

OFCondition ReceiveAssociationFrom(int socket, DcmTransportLayer* secure,
                                   std::chrono::seconds silence,
                                   std::unique_ptr<SocketLayer>* layer, T_ASC_Network** network,
                                   T_ASC_Association** association) {
  const int seconds = static_cast<int>(silence.count());
  Handover handover(socket);
  *layer = std::make_unique<SocketLayer>(secure, silence, [&handover] { handover.Done(); });
  // With a socket handed over it opens none of its own.
  OFCondition done = ASC_initializeNetwork(NET_ACCEPTOR, 0, seconds, network);
  if (done.good()) done = ASC_setTransportLayer(*network, layer->get(), 0);
  if (done.good()) {
    done = ASC_receiveAssociation(*network, association, ASC_MAXIMUMPDUSIZE, nullptr, nullptr,
                                  secure == nullptr ? OFFalse : OFTrue, DUL_NOBLOCK, seconds);
  }
  if (!handover.done()) close(socket);
  return done;
}

}  // namespace tissueform
