import jade.core.AID;
import jade.core.Agent;
import jade.lang.acl.ACLMessage;
import jade.proto.AchieveREInitiator;

/** An agent of JADE that asks one of ours, as the environment says, and prints what it is told, a line each. */
public class Asker extends Agent {
    @Override
    protected void setup() {
        System.out.println("PLATFORM " + getHap());
        if (System.getenv("ASK_TO") == null) {
            return;
        }
        AID to = new AID(System.getenv("ASK_TO"), AID.ISGUID);
        to.addAddresses(System.getenv("ASK_ADDRESS"));
        ACLMessage ask = new ACLMessage(ACLMessage.getInteger(System.getenv("ASK_ACT")));
        ask.addReceiver(to);
        ask.setProtocol(System.getenv("ASK_PROTOCOL"));
        ask.setLanguage(System.getenv("ASK_LANGUAGE"));
        ask.setContent(System.getenv("ASK_CONTENT"));
        ask.setConversationId("asked");
        addBehaviour(new AchieveREInitiator(this, ask) {
            @Override
            protected void handleAgree(ACLMessage told) {
                tell(told);
                if (System.getenv("ASK_CANCEL") != null) {
                    ACLMessage cancel = told.createReply();
                    cancel.setPerformative(ACLMessage.CANCEL);
                    cancel.setReplyWith("to-cancel");
                    send(cancel);
                }
            }

            @Override
            protected void handleRefuse(ACLMessage told) {
                tell(told);
            }

            @Override
            protected void handleInform(ACLMessage told) {
                tell(told);
            }

            @Override
            protected void handleFailure(ACLMessage told) {
                tell(told);
            }

            @Override
            protected void handleNotUnderstood(ACLMessage told) {
                tell(told);
            }

            @Override
            protected void handleOutOfSequence(ACLMessage told) {
                tell(told);
            }
        });
    }

    private static void tell(ACLMessage told) {
        String act = ACLMessage.getPerformative(told.getPerformative()).toLowerCase();
        System.out.println("TOLD " + act + " " + told.getInReplyTo() + " " + told.getContent());
    }
}
