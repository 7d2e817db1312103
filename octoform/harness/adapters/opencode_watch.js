// A plugin of opencode that tells on standard error, one JSON object a line, what its own output leaves out: that a
// reply is coming in, that a tool has begun or prints, and with which HTTP status a request failed that is tried again.
import { writeSync } from "node:fs"

const QUIET_MS = 5000
const tell = (what, more) => writeSync(2, JSON.stringify({ octoform: what, ...more }) + "\n")

const begun = new Set()
let status = null
let told = 0

function piece() {
  if (Date.now() - told < QUIET_MS) return
  told = Date.now()
  tell("piece")
}

function watched(answer) {
  status = answer.ok ? null : answer.status
  if (!answer.ok || !answer.body) return answer
  const through = new TransformStream({
    transform(data, out) {
      piece()
      out.enqueue(data)
    },
  })
  return new Response(answer.body.pipeThrough(through), answer)
}

function tool({ callID, tool, state }) {
  if (state.status !== "running") return
  // It is told of again whenever it has printed something.
  if (begun.has(callID)) return piece()
  begun.add(callID)
  tell("tool", { id: callID, tool, input: state.input })
}

export const Watch = async () => {
  // By now the key is read, and what the agent runs has no use for it.
  delete process.env[process.env.OPENCODE_WATCH_WITHHELD]
  const fetch = globalThis.fetch
  const asked = async (...given) => {
    status = null
    return watched(await fetch(...given))
  }
  globalThis.fetch = Object.assign(asked, fetch)
  return {
    "tool.execute.before": async ({ tool }, { args }) => {
      // A command without an end would be a run without a sign of progress; the agent has to hear of it before.
      const most = Number(process.env.OPENCODE_WATCH_COMMAND_MS)
      if (tool === "bash" && most) args.timeout = Math.min(args.timeout ?? most, most)
    },
    event: async ({ event }) => {
      const { part, status: state } = event.properties ?? {}
      if (event.type === "session.status" && state.type === "retry") {
        tell("retry", { text: state.message, status })
      } else if (event.type === "message.part.updated" && part.type === "tool") {
        tool(part)
      }
    },
  }
}
